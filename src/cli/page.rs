//! A page to draw on: SVG, and the PNG made from it.

use cosserat_rod::package::raster;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;
use std::fs;
use std::path::Path;

/// The backend rounds to whole units of this fraction of a page unit.
const FINE: u32 = 5;
/// Pixels of a PNG in a page unit.
const PIXELS: u32 = 2;

pub const INK: RGBColor = RGBColor(40, 44, 52);
pub const PALE: RGBColor = RGBColor(205, 209, 216);
pub const BLUE: RGBColor = RGBColor(31, 110, 190);
pub const ORANGE: RGBColor = RGBColor(225, 110, 20);
pub const GREEN: RGBColor = RGBColor(30, 145, 90);
pub const RED: RGBColor = RGBColor(200, 45, 60);
pub const VIOLET: RGBColor = RGBColor(125, 75, 175);

pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub type Fallible = Result<(), Box<dyn Error>>;

/// Length on the page.
pub fn px(length: f64) -> i32 {
    (length * f64::from(FINE)) as i32
}

pub fn font(size: f64, color: RGBColor) -> TextStyle<'static> {
    ("Helvetica, Arial, DejaVu Sans, sans-serif", px(size)).into_font().color(&color)
}

pub fn line(color: RGBColor, width: f64) -> ShapeStyle {
    color.stroke_width(px(width) as u32)
}

/// A text whose left (middle, right) stands at `x`, its middle at `y`.
pub fn text(area: &Area<'_>, text: &str, (x, y): (f64, f64), size: f64, color: RGBColor, anchor: HPos) -> Fallible {
    let style = font(size, color).pos(Pos::new(anchor, VPos::Center));
    Ok(area.draw(&Text::new(text.to_owned(), (px(x), px(y)), style))?)
}

/// A drawn page.
pub struct Page {
    svg: String,
}

impl Page {
    /// What `draw` draws on a white page.
    pub fn draw(width: u32, height: u32, draw: impl FnOnce(&Area<'_>) -> Fallible) -> Result<Self, Box<dyn Error>> {
        let mut svg = String::new();
        {
            let page = SVGBackend::with_string(&mut svg, (width * FINE, height * FINE)).into_drawing_area();
            page.fill(&WHITE)?;
            draw(&page)?;
            page.present()?;
        }
        // the fine units stay inside
        let size = |scale: u32| format!("width=\"{}\" height=\"{}\"", width * scale, height * scale);
        Ok(Self { svg: svg.replacen(&size(FINE), &size(1), 1) })
    }

    /// Writes it: as PNG where the name ends so, else as SVG.
    pub fn write(&self, path: &Path) -> Result<(), Box<dyn Error>> {
        let png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
        let bytes = if png { raster::png(&self.svg, PIXELS)? } else { self.svg.clone().into_bytes() };
        Ok(write(path, &bytes)?)
    }
}

/// Writes a file, and the directories above it; an error names the path.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), String> {
    if let Some(directory) = path.parent() {
        fs::create_dir_all(directory).map_err(|error| format!("{}: {error}", directory.display()))?;
    }
    fs::write(path, bytes).map_err(|error| format!("{}: {error}", path.display()))
}
