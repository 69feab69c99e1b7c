//! The rod with its frames, ports and signs: the picture in the documentation, and the icon of the archive.

use crate::fmi2::description::{Xml, markup};
use crate::unit::Parameters;
use quick_xml::events::BytesText;
use std::io;

/// Where in the archive the icon lies.
pub const ICON: &str = "model.png";

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 380.0;

const INK: &str = "#282c34";
const PALE: &str = "#8a919c";
const BLUE: &str = "#1f6ebe";
const RED: &str = "#c82d3c";
const GREEN: &str = "#1e915a";

/// On the page, right and down.
type Point = [f64; 2];

/// The centreline: level at the clamp, hanging lower and lower.
const CURVE: [Point; 4] = [[110.0, 110.0], [290.0, 110.0], [400.0, 170.0], [470.0, 270.0]];

/// A point of the centreline.
fn centre(t: f64) -> Point {
    let u = 1.0 - t;
    let weights = [u * u * u, 3.0 * u * u * t, 3.0 * u * t * t, t * t * t];
    [0, 1].map(|k| CURVE.iter().zip(weights).map(|(point, weight)| weight * point[k]).sum())
}

/// Length of an axis of a body frame.
const AXIS: f64 = 44.0;

/// The direction from `from` to `to`.
fn direction(from: Point, to: Point) -> Point {
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    [x / x.hypot(y), y / x.hypot(y)]
}

fn along(from: Point, direction: Point, length: f64) -> Point {
    [from[0] + length * direction[0], from[1] + length * direction[1]]
}

/// The picture as a file.
pub fn svg() -> String {
    markup(|xml| draw(xml, &Parameters::default().stations))
}

/// Draws it, with stations at these parts of the length: the element `svg`.
pub fn draw(xml: &mut Xml, stations: &[f64]) -> io::Result<()> {
    let (width, height) = (WIDTH.to_string(), HEIGHT.to_string());
    let frame = format!("0 0 {width} {height}");
    xml.create_element("svg")
        .with_attributes([
            ("xmlns", "http://www.w3.org/2000/svg"),
            ("width", width.as_str()),
            ("height", height.as_str()),
            ("viewBox", frame.as_str()),
            ("font-family", "Helvetica, Arial, DejaVu Sans, sans-serif"),
            ("font-size", "14"),
        ])
        .write_inner_content(|xml| {
            path(xml, &format!("M0,0 H{width} V{height} H0 Z"), "none", 0.0, "#ffffff")?;
            clamp(xml)?;
            let [a, b, c, d] = CURVE.map(|[x, y]| format!("{x},{y}"));
            path(xml, &format!("M{a} C{b} {c} {d}"), INK, 7.0, "none")?;
            for part in stations {
                circle(xml, centre(*part), 2.2, "#ffffff", "none")?;
            }
            base(xml)?;
            tip(xml)?;
            arrow(xml, [285.0, 195.0], [0.0, 1.0], 55.0, PALE)?;
            lines(xml, [295.0, 228.0], PALE, ["gravity"])?;
            world(xml)
        })?;
    Ok(())
}

fn clamp(xml: &mut Xml) -> io::Result<()> {
    let [x, y] = CURVE[0];
    path(xml, &format!("M{x},{} V{}", y - 45.0, y + 45.0), INK, 2.0, "none")?;
    let hatch = |k: i32| format!("M{x},{} l-14,14", y - 45.0 + 11.0 * f64::from(k));
    path(xml, &(0..8).map(hatch).collect::<String>(), PALE, 1.2, "none")
}

fn base(xml: &mut Xml) -> io::Result<()> {
    let at = CURVE[0];
    axes(xml, at, direction(at, CURVE[1]))?;
    lines(xml, [20.0, 32.0], BLUE, ["base: position, orientation,", "velocity, angular_velocity in"])?;
    let reaction = [-0.94, 0.34];
    arrow(xml, along(at, reaction, 22.0), reaction, 52.0, RED)?;
    lines(xml, [20.0, 198.0], RED, ["base.reaction_force,", "base.reaction_moment out:", "the rod on its base"])
}

fn tip(xml: &mut Xml) -> io::Result<()> {
    let at = CURVE[3];
    axes(xml, at, direction(CURVE[2], at))?;
    lines(xml, [420.0, 345.0], BLUE, ["tip: position, orientation,", "velocity, angular_velocity out"])?;
    arrow(xml, at, [0.87, -0.5], 70.0, RED)?;
    lines(xml, [450.0, 190.0], RED, ["tip.force, tip.moment in:", "surroundings on the rod"])
}

/// The body frame in the plane of the page, d3 along the rod, d2 into the page as y of the world.
fn axes(xml: &mut Xml, at: Point, d3: Point) -> io::Result<()> {
    let d1 = [-d3[1], d3[0]];
    let name = |xml: &mut Xml, [x, y]: Point, name| lines(xml, [x - 8.0, y + 5.0], GREEN, [name]);
    arrow(xml, at, d3, AXIS, GREEN)?;
    name(xml, along(along(at, d3, AXIS), d1, -14.0), "d3")?;
    arrow(xml, at, d1, AXIS, GREEN)?;
    name(xml, along(at, d1, AXIS + 12.0), "d1")?;
    into(xml, at, GREEN)?;
    name(xml, along(along(at, d1, 17.0), d3, 17.0), "d2")
}

fn world(xml: &mut Xml) -> io::Result<()> {
    let at @ [x, y] = [60.0, 340.0];
    arrow(xml, at, [1.0, 0.0], 50.0, INK)?;
    lines(xml, [x + 56.0, y + 5.0], INK, ["x"])?;
    arrow(xml, at, [0.0, -1.0], 50.0, INK)?;
    lines(xml, [x - 4.0, y - 56.0], INK, ["z"])?;
    into(xml, at, INK)?;
    lines(xml, [x - 18.0, y + 14.0], INK, ["y"])?;
    lines(xml, [x + 85.0, y + 5.0], PALE, ["world frame"])
}

/// The tail of an arrow into the page.
fn into(xml: &mut Xml, at: Point, color: &str) -> io::Result<()> {
    circle(xml, at, 6.0, "#ffffff", color)?;
    let [x, y] = along(at, [-1.0, -1.0], 4.0);
    path(xml, &format!("M{x},{y} l8,8 m0,-8 l-8,8"), color, 1.4, "none")
}

/// An arrow in the direction `to`.
fn arrow(xml: &mut Xml, from: Point, to: Point, length: f64, color: &str) -> io::Result<()> {
    let (end, neck) = (along(from, to, length), along(from, to, length - 10.0));
    let (left, right) = (along(neck, [-to[1], to[0]], 4.5), along(neck, [to[1], -to[0]], 4.5));
    let point = |[x, y]: Point| format!("{x:.1},{y:.1}");
    path(xml, &format!("M{} L{}", point(from), point(neck)), color, 2.2, "none")?;
    path(xml, &format!("M{} L{} L{} Z", point(end), point(left), point(right)), "none", 0.0, color)
}

fn path(xml: &mut Xml, d: &str, stroke: &str, width: f64, fill: &str) -> io::Result<()> {
    xml.create_element("path")
        .with_attributes([("d", d), ("stroke", stroke), ("stroke-width", width.to_string().as_str()), ("fill", fill)])
        .write_empty()?;
    Ok(())
}

fn circle(xml: &mut Xml, [x, y]: Point, radius: f64, fill: &str, stroke: &str) -> io::Result<()> {
    let [x, y, radius] = [x, y, radius].map(|value| format!("{value:.1}"));
    xml.create_element("circle")
        .with_attributes([("cx", x.as_str()), ("cy", &y), ("r", &radius), ("fill", fill), ("stroke", stroke)])
        .write_empty()?;
    Ok(())
}

/// Text, line by line.
fn lines<const N: usize>(xml: &mut Xml, [x, y]: Point, color: &str, texts: [&str; N]) -> io::Result<()> {
    for (k, text) in texts.iter().enumerate() {
        let [x, y] = [x, y + 17.0 * k as f64].map(|value| format!("{value:.1}"));
        xml.create_element("text")
            .with_attributes([("x", x.as_str()), ("y", &y), ("fill", color)])
            .write_text_content(BytesText::new(text))?;
    }
    Ok(())
}
