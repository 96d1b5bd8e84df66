//! Figures as pixels.

use std::path::Path;
use std::sync::Arc;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::{Database, Family, Query};
use resvg::usvg::{Options, Tree};

use crate::error::ReportError;

/// Pixels for one unit of a figure: sharp on a slide.
const SCALE: f32 = 2.0;

/// Sans-serif typefaces that are looked for, in this order.
const TYPEFACES: [&str; 5] = ["DejaVu Sans", "Liberation Sans", "Noto Sans", "Arial", "Helvetica"];

/// Draws with the machine's fonts.
pub struct Painter {
    options: Options<'static>,
}

impl Painter {
    pub fn new() -> Self {
        let mut fonts = Database::new();
        fonts.load_system_fonts();
        let is_there =
            |name: &&str| fonts.query(&Query { families: &[Family::Name(name)], ..Query::default() }).is_some();
        if let Some(name) = TYPEFACES.iter().copied().find(is_there) {
            fonts.set_sans_serif_family(name);
        }
        Self { options: Options { fontdb: Arc::new(fonts), ..Options::default() } }
    }

    /// # Errors
    /// No font on the machine, or a figure that is too large.
    pub fn paint(&self, path: &Path, svg: &str) -> Result<Vec<u8>, ReportError> {
        let failed = |what: String| ReportError::Png { path: path.to_path_buf(), what };
        if self.options.fontdb.is_empty() {
            return Err(failed(
                "there is no font on this machine; install one, for example fonts-dejavu-core".to_owned(),
            ));
        }
        let tree = Tree::from_str(svg, &self.options).map_err(|error| failed(error.to_string()))?;
        let size = tree.size();
        let mut pixels = Pixmap::new((size.width() * SCALE).ceil() as u32, (size.height() * SCALE).ceil() as u32)
            .ok_or_else(|| failed("the figure is too large for a PNG file".to_owned()))?;
        resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
        pixels.encode_png().map_err(|error| failed(error.to_string()))
    }
}
