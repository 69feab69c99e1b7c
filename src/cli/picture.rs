//! The picture of the demo: shapes over time in space, and the curves over time.

use super::page::{Area, BLUE, Fallible, GREEN, INK, ORANGE, PALE, Page, RED, VIOLET, font, line, px};
use cosserat_rod::unit::STATIONS;
use nalgebra::Vector3;
use plotters::prelude::*;
use plotters::style::colors::colormaps::ViridisRGB;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;
use std::ops::Range;

/// What is drawn and printed of a communication point, world frame.
#[derive(Clone, Debug)]
pub struct Frame {
    pub time: f64,
    pub stations: [Vector3<f64>; STATIONS],
    pub tip_orientation: [f64; 4],
    pub reaction: Vector3<f64>,
    pub kinetic: f64,
    pub elastic: f64,
    pub gravity: f64,
    pub dissipated: f64,
    /// Done on the rod by base and tip.
    pub work: f64,
}

impl Frame {
    pub fn base(&self) -> Vector3<f64> {
        self.stations[0]
    }

    pub fn tip(&self) -> Vector3<f64> {
        self.stations[STATIONS - 1]
    }

    /// Constant, were the time scheme exact.
    pub fn balance(&self) -> f64 {
        self.kinetic + self.elastic + self.gravity + self.dissipated - self.work
    }
}

/// On the page.
const WIDTH: u32 = 1200;
const HEIGHT: u32 = 660;
/// The picture.
pub fn draw(frames: &[Frame], subtitle: &str) -> Result<Page, Box<dyn Error>> {
    Page::draw(WIDTH, HEIGHT, |page| {
        let (space, curves) = page.split_horizontally(px(612.0));
        shapes(&space, frames, subtitle)?;
        let panels = curves.split_evenly((3, 1));
        let end = frames[frames.len() - 1].time;
        let xyz = |of: fn(&Frame) -> Vector3<f64>| {
            let component = |k: usize| frames.iter().map(|frame| of(frame)[k]).collect::<Vec<f64>>();
            vec![("x", BLUE, component(0)), ("y", ORANGE, component(1)), ("z", GREEN, component(2))]
        };
        let energy = |of: &dyn Fn(&Frame) -> f64| frames.iter().map(|frame| of(frame) - of(&frames[0])).collect();
        chart(&panels[0], end, "tip position, m", xyz(Frame::tip))?;
        chart(&panels[1], end, "force on the base, N", xyz(|frame| frame.reaction))?;
        let energies = vec![
            ("kinetic", BLUE, energy(&|frame| frame.kinetic)),
            ("elastic", ORANGE, energy(&|frame| frame.elastic)),
            ("gravity", GREEN, energy(&|frame| frame.gravity)),
            ("lost", RED, energy(&|frame| frame.dissipated)),
            ("work done", VIOLET, energy(&|frame| frame.work)),
        ];
        chart(&panels[2], end, "energy since the start, J", energies)
    })
}

/// Curves over time, each with its name at its end.
fn chart(area: &Area<'_>, end: f64, title: &str, curves: Vec<(&str, RGBColor, Vec<f64>)>) -> Fallible {
    let all = curves.iter().flat_map(|(_, _, values)| values.iter().copied());
    let Range { start: low, end: high } = range(all, 0.06);
    let mut chart = ChartBuilder::on(area)
        .margin_top(px(38.0))
        .margin_bottom(px(6.0))
        .margin_right(px(82.0))
        .x_label_area_size(px(24.0))
        .y_label_area_size(px(52.0))
        .build_cartesian_2d(0.0..end, low..high)?;
    let title_style = font(16.0, INK);
    area.draw(&Text::new(title.to_owned(), (px(52.0), px(14.0)), title_style))?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(line(PALE, 0.6))
        .axis_style(line(PALE, 1.0))
        .label_style(font(13.0, INK))
        .x_labels(9)
        .y_labels(6)
        .x_label_formatter(&|time| format!("{time:.1} s"))
        .y_label_formatter(&|value| short(*value))
        .draw()?;
    let step = end / (curves[0].2.len() - 1) as f64;
    let mut ends = Vec::new();
    for (name, color, values) in &curves {
        let points = values.iter().enumerate().map(|(k, value)| (k as f64 * step, *value));
        chart.draw_series(LineSeries::new(points, line(*color, 1.6)))?;
        ends.push((chart.backend_coord(&(end, values[values.len() - 1])).1, *name, *color));
    }
    // names side by side do not touch
    ends.sort_by_key(|(height, ..)| *height);
    let apart = px(15.0);
    for k in 1..ends.len() {
        ends[k].0 = ends[k].0.max(ends[k - 1].0 + apart);
    }
    let bottom = chart.backend_coord(&(end, low)).1;
    for k in (0..ends.len()).rev() {
        let most = bottom - apart * (ends.len() - 1 - k) as i32;
        ends[k].0 = ends[k].0.min(most);
    }
    let (x_0, y_0) = area.get_base_pixel();
    let right = chart.backend_coord(&(end, low)).0 - x_0;
    for (height, name, color) in ends {
        let style = font(14.0, color).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw(&Text::new(name.to_owned(), (right + px(7.0), height - y_0), style))?;
    }
    Ok(())
}

/// Of the values, with a margin on either side.
fn range(values: impl Iterator<Item = f64>, margin: f64) -> Range<f64> {
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)));
    let more = margin * (high - low).max(1e-6);
    low - more..high + more
}

fn short(value: f64) -> String {
    format!("{}", (value * 1e6).round() / 1e6)
}

/// Seen along an oblique axis without perspective: right and up on the page.
fn project(r: &Vector3<f64>) -> (f64, f64) {
    let (azimuth, elevation) = (-58f64.to_radians(), 14f64.to_radians());
    let (right, depth) = (-azimuth.sin() * r.x + azimuth.cos() * r.y, azimuth.cos() * r.x + azimuth.sin() * r.y);
    (right, r.z * elevation.cos() - depth * elevation.sin())
}

/// A smooth curve through the stations.
fn smooth(stations: &[Vector3<f64>; STATIONS]) -> Vec<Vector3<f64>> {
    const PARTS: usize = 6;
    let at = |k: usize| stations[k.min(STATIONS - 1)];
    let mut curve = vec![at(0)];
    for k in 0..STATIONS - 1 {
        // the ends go on as they are
        let before = if k == 0 { at(0) * 2.0 - at(1) } else { at(k - 1) };
        let after = if k + 2 == STATIONS { at(k + 1) * 2.0 - at(k) } else { at(k + 2) };
        let (slope, next_slope) = ((at(k + 1) - before) * 0.5, (after - at(k)) * 0.5);
        for part in 1..=PARTS {
            let x = part as f64 / PARTS as f64;
            let rise = x * x * (3.0 - 2.0 * x);
            let (bend, next_bend) = (x * (1.0 - x) * (1.0 - x), x * x * (x - 1.0));
            curve.push(at(k) * (1.0 - rise) + at(k + 1) * rise + slope * bend + next_slope * next_bend);
        }
    }
    curve
}

/// The rod in space, coloured by time.
fn shapes(area: &Area<'_>, frames: &[Frame], subtitle: &str) -> Fallible {
    const SHAPES: usize = 130;
    const GRID: f64 = 0.2;
    let points = || frames.iter().flat_map(|frame| frame.stations);
    let floor = points().map(|r| r.z).fold(f64::MAX, f64::min) - 0.08;
    let span = |k: usize| {
        let Range { start, end } = range(points().map(|r| r[k]), 0.0);
        ((start / GRID).floor() as i32, (end / GRID).ceil() as i32)
    };
    let ((west, east), (south, north)) = (span(0), span(1));
    let ground = |x: i32, y: i32| project(&Vector3::new(f64::from(x) * GRID, f64::from(y) * GRID, floor));
    let corners = [ground(west, south), ground(west, north), ground(east, south), ground(east, north)];
    let on_page: Vec<(f64, f64)> = points().map(|r| project(&r)).chain(corners).collect();
    let x = range(on_page.iter().map(|at| at.0), 0.02);
    let y = range(on_page.iter().map(|at| at.1), 0.02);

    // equal scales
    let (left, top, width, height) = (20.0, 72.0, 580.0, f64::from(HEIGHT) - 72.0 - 46.0);
    let scale = (width / (x.end - x.start)).min(height / (y.end - y.start));
    let (middle_x, middle_y) = (0.5 * (x.start + x.end), 0.5 * (y.start + y.end));
    let place = |at: (f64, f64)| {
        let (dx, dy) = ((at.0 - middle_x) * scale, (at.1 - middle_y) * scale);
        (px(left + 0.5 * width + dx), px(top + 0.5 * height - dy))
    };
    let path = |points: Vec<(f64, f64)>, style: ShapeStyle| {
        PathElement::new(points.into_iter().map(place).collect::<Vec<_>>(), style)
    };

    for k in west..=east {
        area.draw(&path(vec![ground(k, south), ground(k, north)], line(PALE, 0.6)))?;
    }
    for k in south..=north {
        area.draw(&path(vec![ground(west, k), ground(east, k)], line(PALE, 0.6)))?;
    }
    let shadow = frames.iter().map(|frame| project(&Vector3::new(frame.tip().x, frame.tip().y, floor))).collect();
    area.draw(&path(shadow, line(RGBColor(170, 175, 184), 1.0)))?;

    let end = frames[frames.len() - 1].time;
    let color = |time: f64| ViridisRGB::get_color(0.94 * time / end);
    let every = (frames.len() / SHAPES).max(1);
    for frame in frames.iter().step_by(every) {
        let curve = smooth(&frame.stations).iter().map(project).collect();
        area.draw(&path(curve, color(frame.time).mix(0.55).stroke_width(px(1.3) as u32)))?;
    }
    // the way of the tip
    for pair in frames.windows(2) {
        let way = pair.iter().map(|frame| project(&frame.tip())).collect();
        area.draw(&path(way, line(color(pair[0].time), 0.9)))?;
    }
    let base = frames.iter().map(|frame| project(&frame.base())).collect();
    area.draw(&path(base, line(RED, 4.0)))?;
    for frame in [&frames[0], &frames[frames.len() - 1]] {
        let curve = smooth(&frame.stations).iter().map(project).collect();
        area.draw(&path(curve, line(color(frame.time), 4.0)))?;
        area.draw(&Circle::new(place(project(&frame.tip())), px(5.0), color(frame.time).filled()))?;
    }

    let text = |text: &str, x: f64, y: f64, style: TextStyle<'static>| {
        area.draw(&Text::new(text.to_owned(), (px(x), px(y)), style))
    };
    text("One rod behind FMI 2.0", 30.0, 18.0, font(24.0, INK))?;
    text(subtitle, 30.0, 50.0, font(15.0, INK))?;
    let (x_0, y_0) = place(project(&frames[0].base()));
    let label = font(14.0, RED).pos(Pos::new(HPos::Left, VPos::Bottom));
    area.draw(&Text::new("base".to_owned(), (x_0 + px(14.0), y_0 - px(10.0)), label))?;

    // the scale of time, and of the grid
    let (bar, bottom) = (220.0, f64::from(HEIGHT) - 52.0);
    for k in 0..110 {
        let x = 30.0 + bar * f64::from(k) / 110.0;
        let corners = [(px(x), px(bottom)), (px(x + bar / 110.0 + 0.4), px(bottom + 10.0))];
        area.draw(&Rectangle::new(corners, color(end * f64::from(k) / 110.0).filled()))?;
    }
    text("0 s", 30.0, bottom + 16.0, font(13.0, INK))?;
    let right = font(13.0, INK).pos(Pos::new(HPos::Right, VPos::Top));
    text(&format!("{end:.0} s"), 30.0 + bar, bottom + 16.0, right)?;
    text("grid 0.2 m", 290.0, bottom - 3.0, font(13.0, INK))?;
    Ok(())
}
