//! The map: a panel for every method and scheme, in it the materials and meshes over the time step.

use super::scan::{MATERIALS, Outcome, Verdict};
use super::{CELLS, Case, Method, TIME_STEPS};
use crate::draw::{Area, Fallible, GREY, INK, Picture, px, text};
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;
use std::error::Error;

/// On the page: a square of the map, its panels and what stands left of them.
const SQUARE: (f64, f64) = (13.0, 6.0);
const PANEL: (f64, f64) = (SQUARE.0 * TIME_STEPS.len() as f64, SQUARE.1 * (MATERIALS.len() * CELLS.len()) as f64);
const GAP: (f64, f64) = (14.0, 8.0);
const LEFT: f64 = 190.0;
/// Of what stands above a panel.
const HEAD: f64 = 24.0;
const WIDTH: u32 = 1250;

/// Errors from the first to the second shade of what is fine, as powers of ten.
const SHADES: (f64, f64) = (-4.0, -0.5);

fn shade(error: f64) -> RGBColor {
    let part = ((error.max(1e-12).log10() - SHADES.0) / (SHADES.1 - SHADES.0)).clamp(0.0, 1.0);
    let mix = |from: u8, to: u8| (f64::from(from) + part * (f64::from(to) - f64::from(from))) as u8;
    RGBColor(mix(12, 218), mix(105, 240), mix(62, 205))
}

fn color(verdict: Verdict, error: f64) -> RGBColor {
    match verdict {
        Verdict::Fine => shade(error),
        Verdict::Ringing => RGBColor(245, 200, 60),
        Verdict::Drifted => RGBColor(125, 95, 190),
        Verdict::Growing => RGBColor(232, 125, 35),
        Verdict::Lost => RGBColor(190, 45, 60),
    }
}

fn rectangle(area: &Area<'_>, (x, y): (f64, f64), (width, height): (f64, f64), style: ShapeStyle) -> Fallible {
    Ok(area.draw(&Rectangle::new([(px(x), px(y)), (px(x + width), px(y + height))], style))?)
}

/// Draws all runs; `limits` are the steps at which theory ends a method, by method, scheme, material and cells.
pub fn draw(
    runs: &[(Case, Outcome)],
    limits: impl Fn(Method, usize, usize, usize) -> Vec<f64>,
) -> Result<Picture, Box<dyn Error>> {
    let title = "Stability: a rod released from the horizontal, 200 steps of every size";
    let subtitle = "each panel: steps from 1e-8 to 100 s; from above hair, rubber, steel, each of 6, 25 and 100 cells";
    Picture::new(WIDTH, title, subtitle, |area| {
        let (mut y, mut above) = (0.0, Vec::new());
        for (row, method) in Method::ALL.into_iter().enumerate() {
            let heads = method.heads();
            if heads != above {
                y += HEAD;
                for (column, name) in heads.iter().enumerate() {
                    let x = LEFT + column as f64 * (PANEL.0 + GAP.0) + 0.5 * PANEL.0;
                    text(area, name, (x, y - 12.0), 15.0, INK, HPos::Center)?;
                }
            }
            above = heads;
            for (k, words) in method.name().split(", ").enumerate() {
                let size = if k == 0 { 16.0 } else { 14.0 };
                let color = if k == 0 { INK } else { GREY };
                text(area, words, (24.0, y + 14.0 + 20.0 * k as f64), size, color, HPos::Left)?;
            }
            for (k, material) in MATERIALS.iter().enumerate() {
                let middle = y + (k as f64 + 0.5) * SQUARE.1 * CELLS.len() as f64;
                text(area, material.name, (LEFT - 8.0, middle), 12.0, GREY, HPos::Right)?;
            }
            for column in method.schemes() {
                let x = LEFT + column as f64 * (PANEL.0 + GAP.0);
                for (case, outcome) in runs.iter().filter(|(case, _)| (case.method, case.scheme) == (method, column)) {
                    let line = case.material * CELLS.len() + case.cells;
                    let at = (x + case.step as f64 * SQUARE.0, y + line as f64 * SQUARE.1);
                    let filled = color(outcome.verdict, outcome.error).filled();
                    rectangle(area, at, (SQUARE.0 - 0.8, SQUARE.1 - 0.8), filled)?;
                }
                for material in 0..MATERIALS.len() {
                    for cells in 0..CELLS.len() {
                        for dt in limits(method, column, material, cells) {
                            let right = x + SQUARE.0 * place(dt);
                            let top = y + (material * CELLS.len() + cells) as f64 * SQUARE.1;
                            let ends = [(px(right), px(top)), (px(right), px(top + SQUARE.1))];
                            area.draw(&PathElement::new(ends, INK.stroke_width(px(2.4) as u32)))?;
                        }
                    }
                }
                for k in 1..MATERIALS.len() {
                    let line = y + (k * CELLS.len()) as f64 * SQUARE.1 - 0.4;
                    let ends = [(px(x), px(line)), (px(x + PANEL.0), px(line))];
                    area.draw(&PathElement::new(ends, WHITE.stroke_width(px(2.0) as u32)))?;
                }
                if Method::ALL[row + 1..].iter().all(|below| !below.schemes().contains(&column)) {
                    for (dt, label) in [(1e-8, "1e−8"), (1e-5, "1e−5"), (1e-2, "0.01"), (10.0, "10 s")] {
                        let at = (x + SQUARE.0 * place(dt), y + PANEL.1 + 8.0);
                        text(area, label, at, 12.0, GREY, HPos::Center)?;
                    }
                }
            }
            y += PANEL.1 + GAP.1;
        }
        legend(area, y + 26.0)
    })
}

/// Where a step stands, in squares from the left of a panel: between the squares of the steps around it.
fn place(dt: f64) -> f64 {
    let after = TIME_STEPS.iter().position(|step| *step > dt).unwrap_or(TIME_STEPS.len() - 1).max(1);
    let (low, high) = (TIME_STEPS[after - 1].ln(), TIME_STEPS[after].ln());
    after as f64 - 0.5 + (dt.ln() - low) / (high - low)
}

fn legend(area: &Area<'_>, y: f64) -> Fallible {
    let mut x = LEFT;
    text(area, "fine, error of the tip / length:", (x, y), 14.0, INK, HPos::Left)?;
    x += 180.0;
    for error in [1e-4, 1e-3, 1e-2, 1e-1, 0.3] {
        rectangle(area, (x, y - 8.0), (24.0, 16.0), shade(error).filled())?;
        let label = if error < 0.1 { format!("{error:.0e}").replace('-', "−") } else { format!("{error}") };
        text(area, &label, (x + 30.0, y), 13.0, GREY, HPos::Left)?;
        x += 66.0;
    }
    x += 10.0;
    for verdict in [Verdict::Ringing, Verdict::Drifted, Verdict::Growing, Verdict::Lost] {
        rectangle(area, (x, y - 8.0), (24.0, 16.0), color(verdict, 0.0).filled())?;
        text(area, verdict.name(), (x + 30.0, y), 14.0, INK, HPos::Left)?;
        x += 144.0;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_stands_in_the_middle_of_its_square_and_what_lies_between_two_on_their_border() {
        for (k, dt) in TIME_STEPS.into_iter().enumerate() {
            assert!((place(dt) - (k as f64 + 0.5)).abs() < 1e-12, "{dt}: {}", place(dt));
        }
        for (k, pair) in TIME_STEPS.windows(2).enumerate() {
            assert!((place((pair[0] * pair[1]).sqrt()) - (k as f64 + 1.0)).abs() < 1e-12, "{pair:?}");
        }
    }
}
