//! `documentation/index.html`: what the pages of the repository say of the unit, and every variable of the table.
//!
//! The text is that of the pages, lest two accounts of the limits drift apart. Of Markdown it knows what stands there:
//! headings, paragraphs, lists, code and bold.

use super::sketch;
use crate::fmi2::description::{Xml, markup, triple};
use crate::fmi2::model::Model;
use crate::fmi2::variables::{Kind, ROWS, Row, Variable};
use crate::rest::RestShape;
use crate::unit::Parameters;
use nalgebra::Vector3;
use quick_xml::events::{BytesText, Event};
use std::f64::consts::TAU;
use std::io;

/// Where in the archive it lies.
pub const INDEX: &str = "documentation/index.html";

const README: &str = include_str!("../../README.md");

/// Pages, and what they are called here.
const PAGES: [(&str, &str); 3] = [
    ("Conventions", include_str!("../../docs/variables.md")),
    ("Limits", include_str!("../../docs/limits.md")),
    ("How it works", include_str!("../../docs/how-it-works.md")),
];

const STYLE: &str = "body { font: 15px/1.45 sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #282c34 } \
    table { border-collapse: collapse; width: 100% } svg { max-width: 100%; height: auto } \
    th, td { text-align: left; vertical-align: top; padding: 0.25em 0.9em 0.25em 0; border-bottom: 1px solid #cdd1d8 } \
    code, td:first-child { font-family: monospace }";

/// A heading within a page, a paragraph, or an item of a list, with its markup.
#[derive(Debug, PartialEq)]
enum Block {
    Heading(String),
    Paragraph(String),
    Item(String),
}

/// What stands below the title of a page; tables, pictures and code are left out.
fn blocks(page: &str) -> Vec<Block> {
    let (title, text) = page.split_once("\n\n").unwrap_or_default();
    debug_assert!(title.starts_with("# "), "a page begins with its title");
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    let mut fenced = false;
    for line in text.lines() {
        let fence = line.starts_with("```");
        fenced ^= fence;
        if fence || fenced || line.is_empty() || line.starts_with('|') || line.starts_with("![") {
            blocks.extend(open.take());
            continue;
        }
        if let Some(heading) = line.strip_prefix("## ") {
            blocks.extend(open.replace(Block::Heading(heading.to_owned())));
            continue;
        }
        match (line.strip_prefix("- "), &mut open) {
            (Some(item), _) => blocks.extend(open.replace(Block::Item(item.to_owned()))),
            (None, Some(Block::Paragraph(text) | Block::Item(text))) => {
                text.push(' ');
                text.push_str(line.trim());
            }
            (None, _) => open = Some(Block::Paragraph(line.to_owned())),
        }
    }
    blocks.extend(open);
    blocks
}

/// The whole page of a model.
pub fn index(model: &Model) -> String {
    markup(|xml| {
        xml.write_event(Event::DocType(BytesText::new("html")))?;
        xml.create_element("html")
            .with_attributes([("lang", "en"), ("xmlns", "http://www.w3.org/1999/xhtml")])
            .write_inner_content(|xml| {
                xml.create_element("head").write_inner_content(|xml| {
                    xml.create_element("meta").with_attribute(("charset", "utf-8")).write_empty()?;
                    text(xml, "title", &model.name)?;
                    text(xml, "style", STYLE)
                })?;
                xml.create_element("body").write_inner_content(|xml| body(xml, model))?;
                Ok(())
            })?;
        Ok(())
    })
}

fn body(xml: &mut Xml, model: &Model) -> io::Result<()> {
    text(xml, "h1", &model.name)?;
    let version =
        concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"), ", licence ", env!("CARGO_PKG_LICENSE"));
    text(xml, "p", version)?;
    if *model != Model::default() {
        this_rod(xml, model)?;
    }
    // up to the picture
    for block in blocks(README).iter().take(1) {
        flow(xml, block)?;
    }
    sketch::draw(xml, &model.parameters.stations)?;
    for (title, page) in PAGES {
        text(xml, "h2", title)?;
        let blocks = blocks(page);
        for run in blocks.chunk_by(|a, b| matches!((a, b), (Block::Item(_), Block::Item(_)))) {
            match run {
                [Block::Item(_), ..] => {
                    xml.create_element("ul")
                        .write_inner_content(|xml| run.iter().try_for_each(|item| flow(xml, item)))?;
                }
                _ => run.iter().try_for_each(|block| flow(xml, block))?,
            }
        }
    }
    for (causality, title) in [("input", "Inputs"), ("output", "Outputs"), ("parameter", "Parameters")] {
        text(xml, "h2", title)?;
        table(xml, causality, model)?;
    }
    Ok(())
}

/// What is baked into the model, beside the start values, which stand in the tables.
fn this_rod(xml: &mut Xml, model: &Model) -> io::Result<()> {
    text(xml, "p", &model.description)?;
    let Parameters { length, rest_shape, .. } = &model.parameters;
    if *rest_shape == RestShape::default() {
        return Ok(());
    }
    let count = rest_shape.pieces().len();
    let turn = rest_shape.turn(*length, &Vector3::zeros()) / TAU;
    let pieces = if count == 1 { "one piece".to_owned() } else { format!("{count} pieces") };
    let shape = Block::Paragraph(format!(
        "The unstressed rod has the shape of {pieces} of constant curvature and twist, {length} m long, with {turn:.2} \
         turns of its sections in all. `length` scales that shape as a whole; `rest_curvature` is added to its curvature."
    ));
    flow(xml, &shape)
}

fn text(xml: &mut Xml, element: &str, text: &str) -> io::Result<()> {
    xml.create_element(element).write_text_content(BytesText::new(text))?;
    Ok(())
}

/// A block with its code and its bold words.
fn flow(xml: &mut Xml, block: &Block) -> io::Result<()> {
    let (element, content) = match block {
        Block::Heading(text) => ("h3", text),
        Block::Paragraph(text) => ("p", text),
        Block::Item(text) => ("li", text),
    };
    xml.create_element(element).write_inner_content(|xml| {
        for (k, part) in content.split('`').enumerate() {
            if k % 2 == 1 {
                text(xml, "code", part)?;
                continue;
            }
            for (k, words) in part.split("**").enumerate() {
                match k % 2 {
                    1 => text(xml, "strong", words)?,
                    _ => xml.write_event(Event::Text(BytesText::new(words)))?,
                }
            }
        }
        Ok(())
    })?;
    Ok(())
}

fn table(xml: &mut Xml, causality: &str, model: &Model) -> io::Result<()> {
    let given = causality != "output";
    let mut columns = vec!["name", "unit", "type"];
    if given {
        columns.extend(["start", "allowed"]);
    }
    columns.push("meaning");
    xml.create_element("table").write_inner_content(|xml| {
        line(xml, "th", &columns)?;
        for row in ROWS.iter().filter(|row| triple(row).0 == causality) {
            let first = Variable { row, element: 0 };
            let kind = format!("{}, {}", first.kind().name(), triple(row).1);
            let name = row.of(&model.parameters).to_string();
            let (start, allowed) = (start(row, model), first.allowed().to_string());
            let mut cells = vec![name.as_str(), row.unit, &kind];
            if given {
                cells.extend([start.as_str(), &allowed]);
            }
            let mut meaning = row.meaning(&model.parameters.stations);
            if !row.components.is_empty() {
                meaning += &format!(": {}", row.components.join(", "));
            }
            cells.push(&meaning);
            line(xml, "td", &cells)?;
        }
        Ok(())
    })?;
    Ok(())
}

fn line(xml: &mut Xml, element: &str, cells: &[&str]) -> io::Result<()> {
    xml.create_element("tr").write_inner_content(|xml| cells.iter().try_for_each(|cell| text(xml, element, cell)))?;
    Ok(())
}

/// The start values of the elements, once if they are all the same.
fn start(row: &'static Row, model: &Model) -> String {
    let mut starts = model.starts();
    let elements = (0..row.components.len().max(1)).map(|element| Variable { row, element });
    let mut values: Vec<String> = elements
        .filter_map(|variable| {
            let value = starts(&variable)?;
            Some(match variable.kind() {
                Kind::Boolean => (value != 0.0).to_string(),
                _ => value.to_string(),
            })
        })
        .collect();
    if values.iter().all(|value| *value == values[0]) {
        values.truncate(1);
    }
    values.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pages_have_only_known_markup() {
        for (title, page) in PAGES {
            let blocks = blocks(page);
            assert!(!blocks.is_empty(), "{title}");
            for Block::Heading(text) | Block::Paragraph(text) | Block::Item(text) in &blocks {
                let even = |mark: &str| text.matches(mark).count() % 2 == 0;
                assert!(even("`") && even("**") && !text.contains("]("), "{title}: {text}");
            }
            let bare = blocks.windows(2).find(|pair| matches!(pair, [Block::Heading(_), Block::Heading(_)]));
            assert_eq!(bare, None, "{title}: without its table nothing is left under the first");
        }
    }

    #[test]
    fn blocks_are_headings_paragraphs_and_items() {
        let heading = Block::Heading("Then".to_owned());
        let paragraph = |text: &str| Block::Paragraph(text.to_owned());
        let item = |text: &str| Block::Item(text.to_owned());
        let page =
            "# A\n\none\nline\n\n| a |\n|---|\n- first\n  goes on\n- second\n\n## Then\n\n```\ncode\n```\nlast\n";
        let expected = [paragraph("one line"), item("first goes on"), item("second"), heading, paragraph("last")];
        assert_eq!(blocks(page), expected);
    }
}
