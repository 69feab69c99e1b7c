//! Error over CPU time, on log axes: a page for a scene, and one for all of them.

use super::Chart;
use super::front::{Kind, Measure, Point, codes, front};
use crate::cli::page::{Area, BLUE, Fallible, GREEN, INK, ORANGE, PALE, Page, RED, VIOLET, line, px, text};
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;
use std::error::Error;

/// Of the points of ours that are not on the front.
const FAINT: RGBColor = RGBColor(236, 190, 194);
/// Of lines that help to read.
const GRID: RGBColor = RGBColor(232, 234, 238);
const GREY: RGBColor = RGBColor(110, 115, 125);
/// Of what the reference cannot tell.
const FOG: RGBColor = RGBColor(241, 242, 245);

fn color(kind: Kind) -> RGBColor {
    match kind {
        Kind::Spatial => RGBColor(122, 138, 168),
        Kind::Planar => RGBColor(150, 172, 130),
        Kind::StrainModes => RGBColor(95, 95, 100),
    }
}

/// Powers of ten at the ends of the axes.
#[derive(Clone, Copy)]
struct Axes {
    time: (i32, i32),
    error: (i32, i32),
}

impl Axes {
    /// That hold these charts; nothing is shown below a third of what a reference can tell.
    fn around(charts: &[&Chart], others: &[Point], measures: &[Measure]) -> Self {
        let (mut time, mut error) = ((f64::INFINITY, 0.0f64), (f64::INFINITY, 0.0f64));
        for chart in charts {
            for &measure in measures {
                let floor = chart.outcome.reference.uncertainty(measure) / 3.0;
                let all = chart.outcome.points.iter().chain(others.iter().filter(|point| point.scene == chart.name));
                for (value, cpu) in all.filter_map(|point| Some((point.error(measure)?, point.cpu))) {
                    time = (time.0.min(cpu), time.1.max(cpu));
                    error = (error.0.min(value.max(floor)), error.1.max(value));
                }
            }
        }
        // what is wrong by more than the length is not shown
        let decades = |(low, high): (f64, f64)| (low.log10().floor() as i32, high.log10().ceil() as i32);
        Self { time: decades(time), error: decades((error.0, error.1.min(1.0))) }
    }
}

/// A rectangle on the page in which errors stand over times.
struct Panel<'p, 'a> {
    area: &'p Area<'a>,
    axes: Axes,
    left: f64,
    top: f64,
    width: f64,
    height: f64,
}

impl Panel<'_, '_> {
    fn x(&self, time: f64) -> f64 {
        let (low, high) = self.axes.time;
        self.left + self.width * (time.log10() - f64::from(low)) / f64::from(high - low)
    }

    fn y(&self, error: f64) -> f64 {
        let (low, high) = self.axes.error;
        self.top + self.height * (f64::from(high) - error.log10()) / f64::from(high - low)
    }

    fn place(&self, point: &Point, measure: Measure) -> Option<(f64, f64)> {
        let error = point.error(measure)?;
        let (low, high) = self.axes.error;
        (error.log10() >= f64::from(low) && error.log10() <= f64::from(high))
            .then(|| (self.x(point.cpu), self.y(error)))
    }

    fn stroke(&self, from: (f64, f64), to: (f64, f64), style: ShapeStyle) -> Fallible {
        stroke(self.area, &[from, to], style)
    }

    /// Frame, decades and their names.
    fn ground(&self, uncertainty: f64, size: f64, every: i32) -> Fallible {
        let (bottom, right) = (self.top + self.height, self.left + self.width);
        let fog = self.y(uncertainty).clamp(self.top, bottom);
        let corners = [(px(self.left), px(fog)), (px(right), px(bottom))];
        self.area.draw(&Rectangle::new(corners, FOG.filled()))?;
        for decade in self.axes.time.0..=self.axes.time.1 {
            let x = self.x(10f64.powi(decade));
            self.stroke((x, self.top), (x, bottom), line(GRID, 0.8))?;
            if (decade - self.axes.time.0) % every == 0 {
                text(self.area, &seconds(decade), (x, bottom + 0.9 * size), size, INK, HPos::Center)?;
            }
        }
        for decade in self.axes.error.0..=self.axes.error.1 {
            let y = self.y(10f64.powi(decade));
            self.stroke((self.left, y), (right, y), line(PALE, 0.8))?;
            text(self.area, &power(decade), (self.left - 5.0, y), size, INK, HPos::Right)?;
        }
        let frame = [(px(self.left), px(self.top)), (px(right), px(bottom))];
        Ok(self.area.draw(&Rectangle::new(frame, line(GREY, 0.8)))?)
    }

    /// The fronts of the others below, ours above.
    fn curves(&self, chart: &Chart, others: &[Point], all: &[(&str, Kind)], measure: Measure, named: bool) -> Fallible {
        for (code, kind) in all {
            let theirs = others.iter().filter(|point| point.scene == chart.name && point.code == *code);
            let places: Vec<_> =
                front(theirs, measure).into_iter().filter_map(|point| self.place(point, measure)).collect();
            stroke(self.area, &places, line(color(*kind), 1.1))?;
            for place in places {
                mark(self.area, place, shape(all, code), color(*kind), 2.6)?;
            }
        }
        let ours = &chart.outcome.points;
        for place in ours.iter().filter_map(|point| self.place(point, measure)) {
            mark(self.area, place, Shape::Disc, FAINT, 1.3)?;
        }
        let best: Vec<_> = front(ours, measure).into_iter().filter_map(|point| self.place(point, measure)).collect();
        stroke(self.area, &best, line(RED, 2.6))?;
        for place in best {
            mark(self.area, place, Shape::Disc, RED, 2.2)?;
        }
        for point in ours {
            let (Some(tolerance), Some((x, y))) = (point.tolerance, self.place(point, measure)) else { continue };
            mark(self.area, (x, y), Shape::Goal, RED, 4.2)?;
            if named {
                let name = power(tolerance.log10().round() as i32);
                text(self.area, &name, (x + 7.0, y - 8.0), 11.0, RED, HPos::Left)?;
            }
        }
        Ok(())
    }
}

fn stroke(area: &Area<'_>, points: &[(f64, f64)], style: ShapeStyle) -> Fallible {
    let points: Vec<(i32, i32)> = points.iter().map(|(x, y)| (px(*x), px(*y))).collect();
    Ok(area.draw(&PathElement::new(points, style))?)
}

#[derive(Clone, Copy)]
enum Shape {
    Disc,
    Square,
    Triangle,
    Diamond,
    Cross,
    /// Where a tolerance puts the unit.
    Goal,
}

/// Of a code: another for each of its kind.
fn shape(all: &[(&str, Kind)], code: &str) -> Shape {
    let kind = all.iter().find(|(other, _)| *other == code).map(|(_, kind)| kind);
    let alike = all.iter().filter(|(_, other)| Some(other) == kind);
    let number = alike.take_while(|(other, _)| *other != code).count();
    [Shape::Square, Shape::Triangle, Shape::Diamond, Shape::Cross, Shape::Disc][number % 5]
}

fn mark(area: &Area<'_>, (x, y): (f64, f64), shape: Shape, color: RGBColor, size: f64) -> Fallible {
    let corners = |list: &[(f64, f64)]| -> Vec<(i32, i32)> {
        list.iter().map(|(dx, dy)| (px(x + size * dx), px(y + size * dy))).collect()
    };
    let diamond = [(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)];
    match shape {
        Shape::Disc => area.draw(&Circle::new((px(x), px(y)), px(size), color.filled()))?,
        Shape::Square => {
            let list = [(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)];
            area.draw(&Polygon::new(corners(&list), color.filled()))?;
        }
        Shape::Triangle => {
            area.draw(&Polygon::new(corners(&[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)]), color.filled()))?;
        }
        Shape::Diamond => area.draw(&Polygon::new(corners(&diamond), color.filled()))?,
        Shape::Cross => {
            stroke(area, &[(x - size, y - size), (x + size, y + size)], line(color, 1.2))?;
            stroke(area, &[(x - size, y + size), (x + size, y - size)], line(color, 1.2))?;
        }
        Shape::Goal => {
            area.draw(&Polygon::new(corners(&diamond), WHITE.filled()))?;
            let rim = [&diamond[..], &diamond[..1]].concat();
            area.draw(&PathElement::new(corners(&rim), line(color, 1.5)))?;
        }
    }
    Ok(())
}

/// A power of ten of a second.
fn seconds(decade: i32) -> String {
    let (unit, places) = match decade {
        0.. => ("s", decade),
        -3..=-1 => ("ms", decade + 3),
        _ => ("µs", decade + 6),
    };
    format!("{} {unit}", 10f64.powi(places))
}

fn power(decade: i32) -> String {
    let digit = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        _ => c.to_digit(10).and_then(|d| char::from_u32(0x2070 + d)).unwrap_or(c),
    };
    match decade {
        0 => "1".to_owned(),
        _ => format!("10{}", decade.to_string().chars().map(digit).collect::<String>()),
    }
}

/// An entry of a legend, and what stands before it.
enum Entry<'a> {
    Front,
    Goal,
    Code(&'a str, Kind),
    Fog,
}

impl Entry<'_> {
    fn name(&self) -> String {
        match self {
            Self::Front => "cosserat-rod, best settings".to_owned(),
            Self::Goal => "the unit's choice for a tolerance".to_owned(),
            Self::Code(code, _) => (*code).to_owned(),
            Self::Fog => "not known by the reference".to_owned(),
        }
    }
}

fn entries<'a>(charts: &[&Chart], all: &[(&'a str, Kind)]) -> Vec<Entry<'a>> {
    let goal = charts.iter().any(|chart| chart.outcome.points.iter().any(|point| point.tolerance.is_some()));
    let mut entries = vec![Entry::Front];
    entries.extend(goal.then_some(Entry::Goal));
    entries.extend(all.iter().map(|(code, kind)| Entry::Code(code, *kind)));
    entries.push(Entry::Fog);
    entries
}

fn entry(area: &Area<'_>, (x, y): (f64, f64), entry: &Entry<'_>, all: &[(&str, Kind)], size: f64) -> Fallible {
    let dash = [(x, y), (x + 22.0, y)];
    let middle = (x + 11.0, y);
    match entry {
        Entry::Front => {
            stroke(area, &dash, line(RED, 2.6))?;
            mark(area, middle, Shape::Disc, RED, 2.4)?;
        }
        Entry::Goal => mark(area, middle, Shape::Goal, RED, 4.2)?,
        Entry::Code(code, kind) => {
            stroke(area, &dash, line(color(*kind), 1.3))?;
            mark(area, middle, shape(all, code), color(*kind), 3.0)?;
        }
        Entry::Fog => {
            let corners = [(px(x), px(y - 5.0)), (px(x + 22.0), px(y + 5.0))];
            area.draw(&Rectangle::new(corners, FOG.filled()))?;
            area.draw(&Rectangle::new(corners, line(PALE, 0.8)))?;
        }
    }
    text(area, &entry.name(), (x + 28.0, y), size, INK, HPos::Left)
}

/// Where the entries of a legend stand in rows of this width, and below them the end.
fn rows(entries: &[Entry<'_>], left: f64, top: f64, width: f64, size: f64) -> (Vec<(f64, f64)>, f64) {
    let (mut x, mut y) = (left, top);
    let mut places = Vec::new();
    for entry in entries {
        let length = 48.0 + 0.6 * size * entry.name().chars().count() as f64;
        if x > left && x + length > left + width {
            (x, y) = (left, y + 19.0);
        }
        places.push((x, y));
        x += length;
    }
    (places, y + 19.0)
}

fn axis_title(measure: Measure) -> &'static str {
    match measure {
        Measure::Tip => "error of the tip / length",
        Measure::Reaction => "error of the force on the base / its peak",
    }
}

/// A page for one scene.
pub fn scene(chart: &Chart, others: &[Point]) -> Result<Page, Box<dyn Error>> {
    const SIZE: f64 = 12.0;
    let others: Vec<Point> = others.iter().filter(|point| point.scene == chart.name).cloned().collect();
    let all = codes(&others);
    let measures = if chart.reaction { &Measure::ALL[..] } else { &Measure::ALL[..1] };
    let width = if chart.reaction { 1000.0 } else { 600.0 };
    let entries = entries(&[chart], &all);
    let (places, legend_end) = rows(&entries, 24.0, 66.0, width - 48.0, SIZE);
    let top = legend_end + 26.0;
    let height = 340.0;
    Page::draw(width as u32, (top + height + 56.0) as u32, |page| {
        text(page, &chart.name, (24.0, 22.0), 19.0, INK, HPos::Left)?;
        text(page, &chart.about, (24.0, 44.0), 12.5, GREY, HPos::Left)?;
        for (place, one) in places.into_iter().zip(&entries) {
            entry(page, place, one, &all, SIZE)?;
        }
        let each = (width - 24.0) / measures.len() as f64;
        for (number, &measure) in measures.iter().enumerate() {
            let panel = Panel {
                area: page,
                axes: Axes::around(&[chart], &others, &[measure]),
                left: 62.0 + each * number as f64,
                top,
                width: each - 72.0,
                height,
            };
            panel.ground(chart.outcome.reference.uncertainty(measure), SIZE, 1)?;
            panel.curves(chart, &others, &all, measure, true)?;
            text(page, axis_title(measure), (panel.left - 40.0, top - 16.0), SIZE + 1.0, INK, HPos::Left)?;
            let below = (panel.left + 0.5 * panel.width, top + height + 36.0);
            text(page, "CPU time", below, SIZE + 1.0, INK, HPos::Center)?;
        }
        Ok(())
    })
}

/// All scenes on one page, with the same axes.
pub fn overview(charts: &[Chart], others: &[Point]) -> Result<Page, Box<dyn Error>> {
    const WIDTH: f64 = 1000.0;
    const SIZE: f64 = 11.0;
    const LEFT: f64 = 46.0;
    let charts: Vec<&Chart> = charts.iter().collect();
    let shown = |point: &&Point| charts.iter().any(|chart| chart.name == point.scene);
    let others: Vec<Point> = others.iter().filter(shown).cloned().collect();
    let all = codes(&others);
    let entries = entries(&charts, &all);
    let (places, legend_end) = rows(&entries, 24.0, 64.0, WIDTH - 48.0, 12.0);
    let with_reaction: Vec<&Chart> = charts.iter().copied().filter(|chart| chart.reaction).collect();
    let blocks = [(Measure::Tip, charts.clone()), (Measure::Reaction, with_reaction)];
    let blocks: Vec<_> = blocks.into_iter().filter(|(_, charts)| !charts.is_empty()).collect();
    let (height, head) = (168.0, 34.0);
    // five in a row are as small as can be read
    let columns = |charts: usize| if charts > 5 { 4 } else { charts };
    let row = height + 50.0;
    let block = |charts: usize| head + row * charts.div_ceil(columns(charts)) as f64;
    let total = legend_end + blocks.iter().map(|(_, charts)| block(charts.len())).sum::<f64>() + 10.0;
    // one scale of time for both
    let time = Axes::around(&charts, &others, &Measure::ALL).time;
    Page::draw(WIDTH as u32, total as u32, |page| {
        text(page, "Error over CPU time", (24.0, 22.0), 19.0, INK, HPos::Left)?;
        text(
            page,
            "one thread; lower and further left is better. Blue: other spatial codes; green: planar ones; black: strain modes",
            (24.0, 42.0),
            12.5,
            GREY,
            HPos::Left,
        )?;
        for (place, one) in places.into_iter().zip(&entries) {
            entry(page, place, one, &all, 12.0)?;
        }
        let mut top = legend_end;
        for (measure, charts) in &blocks {
            let axes = Axes { time, ..Axes::around(charts, &others, &[*measure]) };
            let columns = columns(charts.len());
            let cell = (WIDTH - LEFT - 10.0) / columns as f64;
            let title = format!("{}, over CPU time", axis_title(*measure));
            text(page, &title, (24.0, top + 12.0), 14.0, INK, HPos::Left)?;
            for (number, chart) in charts.iter().enumerate() {
                let panel = Panel {
                    area: page,
                    axes,
                    left: LEFT + cell * (number % columns) as f64,
                    top: top + head + 14.0 + row * (number / columns) as f64,
                    width: cell - 44.0,
                    height,
                };
                panel.ground(chart.outcome.reference.uncertainty(*measure), SIZE, 2)?;
                panel.curves(chart, &others, &all, *measure, false)?;
                text(page, &chart.name, (panel.left, panel.top - 10.0), 13.0, INK, HPos::Left)?;
            }
            top += block(charts.len());
        }
        Ok(())
    })
}

/// What the unit makes of a tolerance: the error over it, and its CPU time over that of the cheapest cells and steps that it
/// may be given and that are as accurate as asked.
pub fn calibration(charts: &[Chart]) -> Result<Page, Box<dyn Error>> {
    const SIZE: f64 = 12.0;
    let (width, top, height) = (1000.0, 84.0, 320.0);
    let colors = [RED, BLUE, GREEN, ORANGE, VIOLET, GREY, INK];
    let shapes = [Shape::Disc, Shape::Square, Shape::Triangle, Shape::Diamond, Shape::Cross];
    let error: fn(f64, &Point) -> Option<f64> = |tolerance, point| Some(point.tip_error? / tolerance);
    let cost: fn(f64, &Point) -> Option<f64> = |_, point| point.over_cheapest;
    Page::draw(width as u32, (top + height + 84.0) as u32, |page| {
        text(page, "What the unit makes of a tolerance", (24.0, 22.0), 19.0, INK, HPos::Left)?;
        let panels = [
            ("error of the tip over the tolerance", error, (-4, 1), 3.0),
            ("CPU time over that of the cheapest given cells and steps", cost, (-1, 2), 2.0),
        ];
        for (number, (title, value, range, bound)) in panels.into_iter().enumerate() {
            let axes = Axes { time: (-6, -2), error: range };
            let left = 62.0 + 490.0 * number as f64;
            let panel = Panel { area: page, axes, left, top, width: 410.0, height };
            text(page, title, (left - 40.0, top - 18.0), SIZE + 1.0, INK, HPos::Left)?;
            let above = [(px(left), px(top)), (px(left + panel.width), px(panel.y(bound)))];
            page.draw(&Rectangle::new(above, FOG.filled()))?;
            for decade in axes.time.0..=axes.time.1 {
                let x = panel.x(10f64.powi(decade));
                panel.stroke((x, top), (x, top + height), line(GRID, 0.8))?;
                text(page, &power(decade), (x, top + height + 13.0), SIZE, INK, HPos::Center)?;
            }
            for decade in range.0..=range.1 {
                let y = panel.y(10f64.powi(decade));
                panel.stroke((left, y), (left + panel.width, y), line(PALE, 0.8))?;
                text(page, &power(decade), (left - 5.0, y), SIZE, INK, HPos::Right)?;
            }
            text(page, "tolerance", (left + 205.0, top + height + 32.0), SIZE, INK, HPos::Center)?;
            for (k, chart) in charts.iter().enumerate() {
                let (color, shape) = (colors[k % colors.len()], shapes[k % shapes.len()]);
                let known = chart.outcome.reference.uncertainty(Measure::Tip);
                let (low, high) = (10f64.powi(range.0), 10f64.powi(range.1));
                let places: Vec<_> = chart
                    .outcome
                    .points
                    .iter()
                    .filter_map(|point| Some((point.tolerance.filter(|tolerance| *tolerance >= 3.0 * known)?, point)))
                    .filter_map(|(tolerance, point)| {
                        let value = value(tolerance, point)?.clamp(low, high);
                        Some((panel.x(tolerance), panel.y(value)))
                    })
                    .collect();
                stroke(page, &places, line(color, 1.4))?;
                for place in &places {
                    mark(page, *place, shape, color, 3.4)?;
                }
                if number == 0 {
                    let at = (40.0 + 135.0 * k as f64, top + height + 62.0);
                    mark(page, at, shape, color, 4.0)?;
                    text(page, &chart.name, (at.0 + 10.0, at.1), SIZE, INK, HPos::Left)?;
                }
            }
        }
        text(page, "shaded: more than 3 times the tolerance, or twice the time", (24.0, 44.0), 12.5, GREY, HPos::Left)
    })
}
