//! The documentation site: `README.md`, the pages of `docs/` and what they link to, made by mdBook.
//!
//! Nothing is written twice. The chapters of `docs/SUMMARY.md` are copied to where they lie in the repository, so that
//! their links stay as they are; files that they link to are copied too. Sources become pages that a browser can show, and
//! a folder becomes a list of its files.

use std::collections::BTreeSet;
use std::env;
use std::fmt::Write as _;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::process::Command;

use crate::builds::target_dir;
use crate::files::{copy, failed, remove, write};
use crate::full::finish;
use crate::markdown::links;
use crate::source::read;
use crate::{Failure, link_check};

const SUMMARY: &str = "docs/SUMMARY.md";

/// Built from source, which takes a minute or two, once.
const MDBOOK: &str = "0.5.4";

/// What a browser shows by itself; every other file that a page links to is put into a page.
const SHOWN_AS_THEY_ARE: [&str; 6] = ["html", "svg", "json", "csv", "gif", "png"];

/// Builds the site and gives its first page.
///
/// # Errors
/// A page of `docs/` that is no chapter, a link to a file that is not there, or what mdBook says.
pub fn build(root: &Path) -> Result<PathBuf, Failure> {
    let folder = target_dir(root).join("site-source");
    remove(&folder)?;
    let source = Source::compose(root, folder.join("src"))?;
    if !source.problems.is_empty() {
        return Err(Failure::Task(source.problems.join("\n")));
    }
    write(&folder.join("book.toml"), &read(&root.join("docs/book.toml"))?)?;
    let site = target_dir(root).join("site");
    let mut build = Command::new(mdbook(root)?);
    build.arg("build").arg(&folder).arg("--dest-dir").arg(&site);
    finish(build, "mdBook could not build the site")?;
    Ok(site.join("index.html"))
}

/// Builds the site and follows every link inside it, to the anchor.
///
/// # Errors
/// What `build` refuses, and all dead links.
pub fn check(root: &Path) -> Result<(), Failure> {
    let first = build(root)?;
    let checked = link_check::check(first.parent().unwrap_or(&first))?;
    println!("site: {} pages, {} links inside it, none dead: {}", checked.pages, checked.links, first.display());
    Ok(())
}

/// The program, built on first use.
fn mdbook(root: &Path) -> Result<PathBuf, Failure> {
    let folder = target_dir(root).join("full").join(format!("mdbook-{MDBOOK}"));
    let program = folder.join("bin").join("mdbook");
    if !program.is_file() {
        eprintln!("Building mdBook {MDBOOK}, once ...");
        let mut install = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        // Neither its server nor its watcher, which bring most of its dependencies.
        install.args([
            "install",
            "mdbook",
            "--version",
            MDBOOK,
            "--locked",
            "--no-default-features",
            "--features",
            "search",
        ]);
        install.arg("--root").arg(&folder);
        // Outside of the checkout: its settings are for canter.
        install.current_dir(env::temp_dir());
        finish(install, "mdBook could not be built; check the network")?;
    }
    Ok(program)
}

/// The pages that SUMMARY.md lists, from the repository's root.
///
/// # Errors
/// It cannot be read.
pub fn chapters(root: &Path) -> Result<BTreeSet<PathBuf>, Failure> {
    let summary = read(&root.join(SUMMARY))?;
    Ok(links(&summary).into_iter().map(|link| resolve(Path::new(SUMMARY), &summary[link])).collect())
}

/// The book's source while it is put together. Paths count from the repository's root.
struct Source<'a> {
    root: &'a Path,
    folder: PathBuf,
    chapters: BTreeSet<PathBuf>,
    problems: Vec<String>,
}

impl<'a> Source<'a> {
    fn compose(root: &'a Path, folder: PathBuf) -> Result<Self, Failure> {
        let summary = read(&root.join(SUMMARY))?;
        let mut source = Self { root, folder, chapters: chapters(root)?, problems: Vec::new() };
        source.every_page_is_a_chapter()?;
        // mdBook wants it at the top, beside README.md.
        let at_the_top = source.with_links_for_the_site(Path::new(SUMMARY), &summary, Path::new(""))?;
        write(&source.folder.join("SUMMARY.md"), &at_the_top)?;
        for chapter in source.chapters.clone() {
            match fs::read_to_string(root.join(&chapter)) {
                Ok(page) => {
                    let parent = chapter.parent().unwrap_or(Path::new(""));
                    let page = source.with_links_for_the_site(&chapter, &page, parent)?;
                    write(&source.folder.join(&chapter), &page)?;
                }
                Err(error) => source.problems.push(format!("{SUMMARY}: {}: {error}", chapter.display())),
            }
        }
        Ok(source)
    }

    fn every_page_is_a_chapter(&mut self) -> Result<(), Failure> {
        let mut folders = vec![PathBuf::from("docs")];
        while let Some(folder) = folders.pop() {
            for name in names(&self.root.join(&folder))? {
                let path = folder.join(&name);
                if self.root.join(&path).is_dir() {
                    folders.push(path);
                } else if name.ends_with(".md") && path != Path::new(SUMMARY) && !self.chapters.contains(&path) {
                    self.problems.push(format!("{}: this page is not in {SUMMARY}", path.display()));
                }
            }
        }
        Ok(())
    }

    /// The page with its links as they have to be in a page that lies in `folder` of the site. What they lead to is put
    /// there as well.
    fn with_links_for_the_site(&mut self, page: &Path, text: &str, folder: &Path) -> Result<String, Failure> {
        let mut changed = text.to_owned();
        for link in links(text).into_iter().rev() {
            let target = &text[link.clone()];
            if target.contains(':') || target.starts_with('#') {
                continue;
            }
            let anchor = target.find('#').map_or("", |at| &target[at..]);
            let path = resolve(page, target);
            match self.place(&path)? {
                Some(mut place) => {
                    // What mdBook makes of it, without following its own links there.
                    if place.ends_with("README.md") && page != Path::new(SUMMARY) {
                        place.set_file_name("index.html");
                    }
                    changed.replace_range(link, &format!("{}{anchor}", relative(folder, &place)));
                }
                None => {
                    let line = text[..link.start].matches('\n').count() + 1;
                    let why = if path.extension().is_some_and(|end| end == "md") && self.root.join(&path).exists() {
                        format!("is a page that is not in {SUMMARY}")
                    } else {
                        "is not there".to_owned()
                    };
                    self.problems.push(format!("{}:{line}: {} {why}", page.display(), path.display()));
                }
            }
        }
        Ok(changed)
    }

    /// Puts what a link leads to into the site, and says where it is.
    fn place(&mut self, path: &Path) -> Result<Option<PathBuf>, Failure> {
        let from = self.root.join(path);
        let extension = path.extension().map(|extension| extension.to_string_lossy().into_owned());
        if self.chapters.contains(path) {
            return Ok(Some(path.to_path_buf()));
        }
        if from.is_dir() {
            let first_page = path.join("README.md");
            if self.chapters.contains(&first_page) {
                return Ok(Some(first_page));
            }
            let mut list = String::new();
            for name in names(&from)?.iter().filter(|name| from.join(name).is_file()) {
                if let Some(place) = self.place(&path.join(name))? {
                    let href = relative(path, &place);
                    let href = href.strip_suffix(".md").map_or(href.clone(), |page| format!("{page}.html"));
                    let _ = writeln!(list, "<li><a href=\"{}\">{}</a></li>", escape(&href), escape(name));
                }
            }
            let place = path.join("index.html");
            write(&self.folder.join(&place), &page(path, &format!("<ul>\n{list}</ul>")))?;
            return Ok(Some(place));
        }
        match extension.as_deref() {
            _ if !from.is_file() => Ok(None),
            Some("md") => Ok(None),
            Some(extension) if SHOWN_AS_THEY_ARE.contains(&extension) => {
                let to = self.folder.join(path);
                copy(&from, &to)?;
                Ok(Some(path.to_path_buf()))
            }
            _ => {
                let bytes = fs::read(&from).map_err(|error| failed("read", &from, &error))?;
                let Ok(text) = String::from_utf8(bytes) else {
                    let to = self.folder.join(path);
                    copy(&from, &to)?;
                    return Ok(Some(path.to_path_buf()));
                };
                let place = PathBuf::from(format!("{}.html", path.display()));
                let content = format!("<pre>{}</pre>", escape(&text));
                write(&self.folder.join(&place), &page(path, &content))?;
                Ok(Some(place))
            }
        }
    }
}

/// A page without mdBook's frame.
fn page(path: &Path, content: &str) -> String {
    let title = escape(&path.to_string_lossy());
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title></head>\n\
         <body><h1>{title}</h1>\n{content}\n</body></html>\n"
    )
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Where a link in a page leads, without its anchor.
fn resolve(page: &Path, link: &str) -> PathBuf {
    let file = link.split('#').next().unwrap_or_default();
    let mut path = page.parent().unwrap_or(Path::new("")).to_path_buf();
    for component in Path::new(file).components() {
        match component {
            Component::ParentDir => drop(path.pop()),
            Component::CurDir => {}
            other => path.push(other),
        }
    }
    path
}

/// The path from a folder to a file, both from the same root.
fn relative(folder: &Path, file: &Path) -> String {
    let common = folder.components().zip(file.components()).take_while(|(one, other)| one == other).count();
    let up = folder.components().skip(common).map(|_| "..".to_owned());
    let down = file.components().skip(common).map(|part| part.as_os_str().to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<_>>().join("/")
}

/// The names in a folder, sorted.
fn names(folder: &Path) -> Result<Vec<String>, Failure> {
    let entries = fs::read_dir(folder).map_err(|error| failed("read", folder, &error))?;
    let mut names: Vec<_> =
        entries.filter_map(Result::ok).map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_lead_up_and_down() {
        assert_eq!(resolve(Path::new("docs/results/README.md"), "../protocol.md#a"), Path::new("docs/protocol.md"));
        assert_eq!(resolve(Path::new("README.md"), "docs/adr"), Path::new("docs/adr"));
        assert_eq!(relative(Path::new("docs"), Path::new("docs/adr/index.html")), "adr/index.html");
        assert_eq!(relative(Path::new("docs/results"), Path::new("README.md")), "../../README.md");
        assert_eq!(relative(Path::new(""), Path::new("docs/start.md")), "docs/start.md");
    }
}
