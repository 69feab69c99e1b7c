//! Pixels from SVG, with a font that comes with the program.

use resvg::{tiny_skia, usvg};
use std::fmt;
use std::sync::Arc;

/// Why there are no pixels.
#[derive(Debug)]
pub enum Error {
    /// The text is no SVG.
    Svg(usvg::Error),
    /// A picture without width or height, or too large.
    Size {
        /// In pixels.
        width: u32,
        /// In pixels.
        height: u32,
    },
    /// The pixels cannot be encoded.
    Encoding(String),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Svg(error) => write!(f, "the picture is no SVG: {error}"),
            Self::Size { width, height } => write!(f, "a picture of {width} by {height} pixels"),
            Self::Encoding(error) => write!(f, "the picture cannot be encoded: {error}"),
        }
    }
}

impl std::error::Error for Error {}

/// The picture as PNG, with `scale` pixels to a unit of the SVG.
///
/// # Errors
/// [`Error`]
pub fn png(svg: &str, scale: u32) -> Result<Vec<u8>, Error> {
    let mut options = usvg::Options::default();
    Arc::make_mut(&mut options.fontdb).load_font_data(dejavu::sans::regular().to_vec());
    let tree = usvg::Tree::from_str(svg, &options).map_err(Error::Svg)?;
    let size = tree.size().to_int_size();
    let (width, height) = (size.width() * scale, size.height() * scale);
    let mut pixels = tiny_skia::Pixmap::new(width, height).ok_or(Error::Size { width, height })?;
    let scale = tiny_skia::Transform::from_scale(scale as f32, scale as f32);
    resvg::render(&tree, scale, &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| Error::Encoding(error.to_string()))
}
