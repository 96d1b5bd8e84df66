//! The page's own files, built into the program.

use crate::answer::Answer;

/// Name and content, `index.html` among them; nothing where the page was not built (see build.rs).
static FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/page.rs"));

/// Stands in for the page.
const HOW_TO_GET_IT: &str = include_str!("without_page.html");

/// Whether the page was built before the program was.
#[must_use]
pub fn is_built() -> bool {
    !FILES.is_empty()
}

/// A file by the path in its address.
pub fn answer(path: &str) -> Answer {
    let name = match path.strip_prefix('/') {
        Some("" | "index.html") => "index.html",
        Some(name) => name,
        None => path,
    };
    match FILES.iter().find(|(file, _)| *file == name) {
        Some((name, content)) => Answer::file(content_type(name), content),
        None if name == "index.html" => Answer::file(content_type(name), HOW_TO_GET_IT.as_bytes()),
        None => Answer::refusal(404, "there is nothing at this address"),
    }
}

fn content_type(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("txt") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}
