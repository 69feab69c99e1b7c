//! What an example hands back: a picture and its numbers.

use crate::draw::Picture;
use std::fmt;
use std::fs;
use std::path::Path;

/// Longer tables are not printed.
const MOST_ROWS: usize = 100;

/// The outcome of an example.
pub struct Example {
    pub name: &'static str,
    pub picture: Picture,
    pub numbers: Numbers,
}

/// A table, under what was chosen where the paper leaves it open.
pub struct Numbers {
    pub chosen: Vec<String>,
    pub head: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Example {
    /// Writes `name.svg`, `name.png` and `name.csv`.
    pub fn write(&self, folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
        write_picture(folder, self.name, &self.picture)?;
        let mut table = csv::Writer::from_path(folder.join(self.name).with_extension("csv"))?;
        table.write_record(&self.numbers.head)?;
        for row in &self.numbers.rows {
            table.write_record(row)?;
        }
        Ok(table.flush()?)
    }
}

/// Writes `name.svg` and `name.png`.
pub fn write_picture(folder: &Path, name: &str, picture: &Picture) -> Result<(), Box<dyn std::error::Error>> {
    fs::write(folder.join(name).with_extension("svg"), &picture.svg)?;
    Ok(fs::write(folder.join(name).with_extension("png"), picture.png()?)?)
}

/// The head of a table.
pub fn head(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

impl fmt::Display for Numbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for line in &self.chosen {
            writeln!(f, "  {line}")?;
        }
        if self.rows.len() > MOST_ROWS {
            return writeln!(f, "  {} runs: see the CSV", self.rows.len());
        }
        let lines: Vec<Vec<&str>> =
            std::iter::once(&self.head).chain(&self.rows).map(|row| row.iter().map(String::as_str).collect()).collect();
        let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.head.len()).map(width).collect();
        for line in lines {
            write!(f, "  ")?;
            for (k, cell) in line.iter().enumerate() {
                // words to the left, numbers to the right
                let pad = " ".repeat(widths[k] - cell.chars().count());
                if k == 0 { write!(f, "{cell}{pad}")? } else { write!(f, "   {pad}{cell}")? }
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: usize) -> String {
        let row = |i: usize| vec!["ω²".to_owned(), (10 * i).to_string()];
        Numbers { chosen: vec!["g".to_owned()], head: head(&["what", "x"]), rows: (0..rows).map(row).collect() }
            .to_string()
    }

    #[test]
    fn a_table_stands_in_columns_counted_in_characters() {
        assert_eq!(table(2), "  g\n  what    x\n  ω²      0\n  ω²     10\n");
    }

    #[test]
    fn a_long_table_is_left_to_its_file() {
        assert_eq!(table(MOST_ROWS + 1), "  g\n  101 runs: see the CSV\n");
    }
}
