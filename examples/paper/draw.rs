//! Pictures: rods in space and curves over an axis. Each is drawn once, as SVG, and the PNG is made from that, with a
//! font that comes with the program.

use crate::scene::Vec3;
use nalgebra::Matrix3;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
pub use plotters::prelude::RGBColor;
use plotters::prelude::*;
use plotters::style::colors::colormaps::ViridisRGB;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use resvg::{tiny_skia, usvg};
use std::error::Error;
use std::fmt::Write;
use std::ops::Range;
use std::sync::Arc;

pub const INK: RGBColor = RGBColor(40, 44, 52);
pub const GREY: RGBColor = RGBColor(150, 155, 164);
pub const PALE: RGBColor = RGBColor(216, 219, 225);
pub const BLUE: RGBColor = RGBColor(31, 110, 190);
pub const ORANGE: RGBColor = RGBColor(225, 110, 20);
pub const GREEN: RGBColor = RGBColor(30, 145, 90);
pub const RED: RGBColor = RGBColor(200, 45, 60);
pub const VIOLET: RGBColor = RGBColor(125, 75, 175);
/// For curves of one kind.
pub const COLORS: [RGBColor; 6] = [BLUE, ORANGE, GREEN, RED, VIOLET, RGBColor(120, 85, 60)];

/// The backend rounds to whole units of this fraction of a page unit.
const FINE: u32 = 5;
/// Of all pictures; wide ones have more width.
const HEIGHT: u32 = 700;
/// Above every picture, for its title.
const HEAD: u32 = 78;
const FONT: &str = "DejaVu Sans, Helvetica, Arial, sans-serif";

pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub type Fallible = Result<(), Box<dyn Error>>;

/// A finished picture.
pub struct Picture {
    pub svg: String,
    width: u32,
    height: u32,
}

/// Length on the page.
pub fn px(length: f64) -> i32 {
    (length * f64::from(FINE)) as i32
}

fn font(size: f64, color: RGBColor) -> TextStyle<'static> {
    (FONT, px(size)).into_font().color(&color)
}

fn line(color: RGBColor, width: f64) -> ShapeStyle {
    color.stroke_width(px(width) as u32)
}

/// A text whose left (middle, right) stands at `x`, its middle at `y`.
pub fn text(area: &Area<'_>, text: &str, (x, y): (f64, f64), size: f64, color: RGBColor, anchor: HPos) -> Fallible {
    let style = font(size, color).pos(Pos::new(anchor, VPos::Center));
    Ok(area.draw(&Text::new(text.to_owned(), (px(x), px(y)), style))?)
}

/// The part of an area at `(x, y)` of the size `(width, height)`.
pub fn part<'a>(area: &Area<'a>, (x, y): (f64, f64), (width, height): (f64, f64)) -> Area<'a> {
    area.clone().shrink((px(x), px(y)), (px(width), px(height)))
}

/// Width and height of an area.
pub fn size(area: &Area<'_>) -> (f64, f64) {
    let (width, height) = area.dim_in_pixel();
    (f64::from(width / FINE), f64::from(height / FINE))
}

/// The colour of a moment, as the fraction of the time shown.
pub fn time_color(fraction: f64) -> RGBColor {
    ViridisRGB::get_color(0.9 * fraction.clamp(0.0, 1.0))
}

impl Picture {
    /// A picture `width` wide; `draw` gets what is below the title.
    pub fn new(
        width: u32,
        title: &str,
        subtitle: &str,
        draw: impl FnOnce(&Area<'_>) -> Fallible,
    ) -> Result<Self, Box<dyn Error>> {
        let mut svg = String::new();
        {
            let page = SVGBackend::with_string(&mut svg, (width * FINE, HEIGHT * FINE)).into_drawing_area();
            page.fill(&WHITE)?;
            text(&page, title, (26.0, 30.0), 25.0, INK, HPos::Left)?;
            text(&page, subtitle, (26.0, 58.0), 16.0, GREY, HPos::Left)?;
            let (_, below) = page.split_vertically(px(f64::from(HEAD)));
            draw(&below)?;
            page.present()?;
        }
        // the fine units stay inside
        let svg = svg.replacen(&dimensions(width * FINE, HEIGHT * FINE), &dimensions(width, HEIGHT), 1);
        let svg = svg.replace("<polyline ", "<polyline stroke-linecap=\"round\" stroke-linejoin=\"round\" ");
        Ok(Self { svg, width, height: HEIGHT })
    }

    /// Rows of pictures on one sheet, every row as wide as the first.
    pub fn sheet(rows: &[Vec<&Self>]) -> Self {
        let width_of = |row: &[&Self]| row.iter().map(|picture| picture.width).sum::<u32>();
        let width = rows.first().map_or(0, |row| width_of(row));
        let (mut body, mut top) = (String::new(), 0.0);
        for row in rows {
            let scale = f64::from(width) / f64::from(width_of(row));
            let mut left = 0.0;
            for picture in row {
                let (w, h) = (f64::from(picture.width) * scale, f64::from(picture.height) * scale);
                let place = format!("<svg x=\"{left}\" y=\"{top}\" width=\"{w}\" height=\"{h}\" ");
                let own = format!("<svg {} ", dimensions(picture.width, picture.height));
                body.push_str(&picture.svg.replacen(&own, &place, 1));
                left += w;
            }
            top += f64::from(HEIGHT) * scale;
        }
        let height = top.ceil() as u32;
        let mut svg = format!("<svg {} xmlns=\"http://www.w3.org/2000/svg\">\n", dimensions(width, height));
        let _ = writeln!(svg, "{body}</svg>");
        Self { svg, width, height }
    }

    /// As PNG.
    pub fn png(&self) -> Result<Vec<u8>, Box<dyn Error>> {
        let mut options = usvg::Options { font_family: "DejaVu Sans".to_owned(), ..usvg::Options::default() };
        Arc::make_mut(&mut options.fontdb).load_font_data(dejavu::sans::regular().to_vec());
        let tree = usvg::Tree::from_str(&self.svg, &options)?;
        let mut pixels = tiny_skia::Pixmap::new(self.width, self.height).ok_or("a picture of no size")?;
        resvg::render(&tree, tiny_skia::Transform::default(), &mut pixels.as_mut());
        Ok(pixels.encode_png()?)
    }
}

fn dimensions(width: u32, height: u32) -> String {
    format!("width=\"{width}\" height=\"{height}\"")
}

/// A curve of a chart.
pub struct Curve {
    pub name: String,
    pub color: RGBColor,
    pub width: f64,
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    pub fn new(name: impl Into<String>, color: RGBColor, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), color, width: 2.2, points }
    }
}

/// What stands at a chart.
#[derive(Clone, Copy)]
pub struct Axes<'a> {
    pub title: &'a str,
    /// With its unit.
    pub x: &'a str,
    /// Whether both axes count powers of ten; then whole ones are shown.
    pub log: bool,
    /// The smallest and largest y shown; beyond them curves are cut.
    pub y: Option<(f64, f64)>,
}

impl<'a> Axes<'a> {
    pub fn linear(title: &'a str, x: &'a str) -> Self {
        Self { title, x, log: false, y: None }
    }
}

/// Curves, with their names above them.
pub fn chart(area: &Area<'_>, axes: Axes<'_>, curves: &[Curve]) -> Fallible {
    let all = || curves.iter().flat_map(|curve| curve.points.iter().copied());
    let (x, y) = (range(all().map(|point| point.0)), range(all().map(|point| point.1)));
    if axes.log {
        let decades = |range: Range<f64>| 10f64.powf(range.start.log10().floor())..10f64.powf(range.end.log10().ceil());
        return chart_on(area, axes, curves, decades(x).log_scale(), decades(y).log_scale());
    }
    let more = 0.05 * (y.end - y.start).max(1e-12);
    let y = axes.y.map_or(y.start - more..y.end + more, |(low, high)| low..high);
    chart_on(area, axes, curves, x, y)
}

fn chart_on<X, Y>(area: &Area<'_>, axes: Axes<'_>, curves: &[Curve], x: X, y: Y) -> Fallible
where
    X: plotters::coord::ranged1d::AsRangedCoord<Value = f64>,
    Y: plotters::coord::ranged1d::AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64> + Ranged<ValueType = f64>,
    Y::CoordDescType: ValueFormatter<f64> + Ranged<ValueType = f64>,
{
    let (width, _) = size(area);
    text(area, axes.title, (26.0, 12.0), 17.0, INK, HPos::Left)?;
    let named: Vec<&Curve> = curves.iter().filter(|curve| !curve.name.is_empty()).collect();
    // the names stand under the title, where no curve runs, in as many rows as they need
    let mut place = (70.0, 36.0);
    let mut places = Vec::new();
    for curve in &named {
        let length = 50.0 + 7.5 * curve.name.chars().count() as f64;
        if place.0 + length > width && place.0 > 70.0 {
            place = (70.0, place.1 + 19.0);
        }
        places.push(place);
        place.0 += length;
    }
    let mut chart = ChartBuilder::on(area)
        .margin_top(px(if named.is_empty() { 30.0 } else { place.1 + 18.0 }))
        .margin_bottom(px(4.0))
        .margin_right(px(26.0))
        .margin_left(px(8.0))
        .x_label_area_size(px(46.0))
        .y_label_area_size(px(62.0))
        .build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(line(PALE, 0.7))
        .axis_style(line(GREY, 1.0))
        .label_style(font(15.0, INK))
        .x_desc(axes.x)
        .axis_desc_style(font(15.0, INK))
        .x_labels((width / 90.0) as usize)
        .y_labels(7)
        .x_label_formatter(&|value| short(*value))
        .y_label_formatter(&|value| short(*value))
        .draw()?;
    let Range { start: low, end: high } = chart.y_range();
    // what has left the chart for good stays near it: the page has no coordinates for it
    let near = |(x, y): (f64, f64)| (x, y.clamp(2.0 * low - high, 2.0 * high - low));
    for curve in curves {
        let points = curve.points.iter().copied().filter(|point| point.1.is_finite()).map(near);
        chart.draw_series(LineSeries::new(points, line(curve.color, curve.width)))?;
    }
    for (curve, (x, y)) in named.iter().zip(places) {
        let dash = [(px(x), px(y)), (px(x + 24.0), px(y))];
        area.draw(&PathElement::new(dash, line(curve.color, curve.width.max(3.0))))?;
        text(area, &curve.name, (x + 31.0, y), 14.5, INK, HPos::Left)?;
    }
    Ok(())
}

fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)));
    low..high
}

/// A number at an axis: powers of ten where it is far from 1.
pub fn short(value: f64) -> String {
    let size = value.abs();
    let text = if size != 0.0 && !(1e-3..1e5).contains(&size) {
        // rounded: an axis makes its powers of ten by multiplication
        format!("{value:.0e}")
    } else {
        format!("{}", (value * 1e6).round() / 1e6)
    };
    text.replace('-', "−")
}

/// A line in space.
pub struct Strand {
    pub points: Vec<Vec3>,
    pub color: RGBColor,
    /// On the page.
    pub width: f64,
    /// Whether it covers, with a pale rim, what is behind it; then it is sorted piece by piece.
    pub rim: bool,
}

/// Where one looks from, without perspective: the azimuth of the eye about +z counted from +x, and its height, degrees.
#[derive(Clone, Copy)]
pub struct Eye {
    pub azimuth: f64,
    pub elevation: f64,
}

impl Eye {
    /// Right, up, and towards the eye.
    fn project(&self, r: &Vec3) -> (f64, f64, f64) {
        let (sin, cos) = self.azimuth.to_radians().sin_cos();
        let (rise, run) = self.elevation.to_radians().sin_cos();
        let (right, out) = (-sin * r.x + cos * r.y, cos * r.x + sin * r.y);
        (right, r.z * run - out * rise, out * run + r.z * rise)
    }
}

/// What stands around the strands.
pub struct Space<'a> {
    pub eye: Eye,
    pub strands: &'a [Strand],
    /// Clamps: where, how turned, and half the edge of the plate drawn, m.
    pub clamps: &'a [(Vec3, Matrix3<f64>, f64)],
    /// Ways of points, drawn thin.
    pub ways: &'a [Strand],
    /// A floor this far below everything with a grid of this width, m.
    pub floor: Option<(f64, f64)>,
}

/// Strands in space with equal scales in all directions.
pub fn space(area: &Area<'_>, space: &Space<'_>) -> Fallible {
    let Space { eye, strands, clamps, ways, floor } = space;
    let plates: Vec<[Vec3; 4]> = clamps
        .iter()
        .map(|(r, rotation, half)| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, y)| r + rotation * Vec3::new(x, y, 0.0) * *half)
        })
        .collect();
    let points = || strands.iter().chain(*ways).flat_map(|strand| &strand.points).chain(plates.iter().flatten());
    let mut ground: Vec<[Vec3; 2]> = Vec::new();
    let mut level = None;
    if let Some((below, grid)) = floor {
        let z = points().map(|r| r.z).fold(f64::MAX, f64::min) - below;
        let span = |k: usize| {
            let Range { start, end } = range(points().map(|r| r[k]));
            ((start / grid).floor() as i32, (end / grid).ceil() as i32)
        };
        let ((west, east), (south, north)) = (span(0), span(1));
        let at = |x: i32, y: i32| Vec3::new(f64::from(x) * grid, f64::from(y) * grid, z);
        ground.extend((west..=east).map(|x| [at(x, south), at(x, north)]));
        ground.extend((south..=north).map(|y| [at(west, y), at(east, y)]));
        level = Some(z);
    }
    let flat: Vec<(f64, f64, f64)> = points().chain(ground.iter().flatten()).map(|r| eye.project(r)).collect();
    let (x, y) = (range(flat.iter().map(|at| at.0)), range(flat.iter().map(|at| at.1)));
    let (width, height) = size(area);
    let scale = ((width - 52.0) / (x.end - x.start)).min((height - 24.0) / (y.end - y.start));
    let (middle_x, middle_y) = (0.5 * (x.start + x.end), 0.5 * (y.start + y.end));
    let fine = |r: &Vec3| {
        let (right, up, _) = eye.project(r);
        (px(0.5 * width + (right - middle_x) * scale), px(0.5 * height - (up - middle_y) * scale))
    };
    let draw = |points: &[Vec3], style: ShapeStyle| -> Fallible {
        Ok(area.draw(&PathElement::new(points.iter().map(&fine).collect::<Vec<_>>(), style))?)
    };

    for pair in &ground {
        draw(pair, line(PALE, 0.7))?;
    }
    if let Some(z) = level {
        for strand in *strands {
            let shadow: Vec<Vec3> = strand.points.iter().map(|r| Vec3::new(r.x, r.y, z)).collect();
            draw(&shadow, RGBColor(226, 228, 233).stroke_width(px(strand.width.min(3.0)) as u32))?;
        }
    }
    for plate in &plates {
        let corners: Vec<(i32, i32)> = plate.iter().map(&fine).collect();
        area.draw(&Polygon::new(corners.clone(), PALE.filled()))?;
        area.draw(&PathElement::new([&corners[..], &corners[..1]].concat(), line(GREY, 1.2)))?;
    }

    for way in *ways {
        draw(&way.points, line(way.color, way.width))?;
    }
    // the farthest first: whole strands, or their pieces
    let mut pieces: Vec<(f64, &[Vec3], usize, &Strand)> = Vec::new();
    for strand in *strands {
        let count = strand.points.len();
        if strand.rim {
            for j in 0..count - 1 {
                // a piece reaches into its neighbours, so that no rim cuts the strand itself
                let (from, to) = (j.saturating_sub(1), (j + 2).min(count - 1));
                let depth = eye.project(&(0.5 * (strand.points[j] + strand.points[j + 1]))).2;
                pieces.push((depth, &strand.points[from..=to], j - from, strand));
            }
        } else {
            let depth = strand.points.iter().map(|r| eye.project(r).2).sum::<f64>() / count as f64;
            pieces.push((depth, &strand.points, 0, strand));
        }
    }
    pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, points, own, strand) in pieces {
        if strand.rim {
            draw(&points[own..=own + 1], line(WHITE, strand.width + 2.4))?;
        }
        draw(points, line(strand.color, strand.width))?;
    }
    Ok(())
}

/// The colours of time, from 0 to `end`.
pub fn time_bar(area: &Area<'_>, (x, y): (f64, f64), width: f64, end: f64) -> Fallible {
    const PARTS: usize = 90;
    for k in 0..PARTS {
        let at = |k: usize| px(x + width * k as f64 / PARTS as f64);
        let corners = [(at(k), px(y)), (at(k + 1) + px(0.4), px(y + 10.0))];
        area.draw(&Rectangle::new(corners, time_color(k as f64 / PARTS as f64).filled()))?;
    }
    text(area, "0 s", (x, y + 22.0), 14.0, INK, HPos::Left)?;
    text(area, &format!("{} s", short(end)), (x + width, y + 22.0), 14.0, INK, HPos::Right)
}
