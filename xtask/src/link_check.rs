//! Follows the links between the pages of a built site.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::Failure;
use crate::source::read;

/// How much was looked at.
#[derive(Debug)]
pub struct Checked {
    pub pages: usize,
    pub links: usize,
}

/// The page for an address that does not exist: its links count from the server's top.
const NOT_FOUND: &str = "404.html";

/// Follows every link of every HTML page below `site` that stays inside it. Links to other sites are not tried: a check must
/// not need them.
///
/// # Errors
/// All links to a file that is not there, or to an anchor that its page does not have.
pub fn check(site: &Path) -> Result<Checked, Failure> {
    let mut pages = BTreeMap::new();
    for path in html_files(site) {
        let html = read(&path)?;
        pages.insert(path.clone(), (attributes(&html, &["id", "name"]), attributes(&html, &["href", "src"])));
    }
    let (mut dead, mut num_links) = (Vec::new(), 0);
    for (page, (_, links)) in &pages {
        for link in links.iter().filter(|link| !link.contains(':') && !link.starts_with("//")) {
            num_links += 1;
            let (file, anchor) = link.split_once('#').unwrap_or((link.as_str(), ""));
            let target = if file.is_empty() { page.clone() } else { target(page, file) };
            let what = match pages.get(&target) {
                None if target.is_file() => continue,
                None => "there is no such file",
                Some((ids, _)) if anchor.is_empty() || ids.contains(anchor) => continue,
                Some(_) => "that page has no such anchor",
            };
            let shown = page.strip_prefix(site).unwrap_or(page).display();
            dead.push(format!("{shown}: `{link}`: {what}"));
        }
    }
    if !dead.is_empty() {
        return Err(Failure::Task(format!("dead links in {}:\n{}", site.display(), dead.join("\n"))));
    }
    Ok(Checked { pages: pages.len(), links: num_links })
}

fn target(page: &Path, file: &str) -> PathBuf {
    let mut path = page.parent().unwrap_or(page).to_path_buf();
    for part in file.split('/') {
        match part {
            ".." => drop(path.pop()),
            "." | "" => {}
            name => path.push(name),
        }
    }
    if path.is_dir() { path.join("index.html") } else { path }
}

fn html_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            files.extend(html_files(&path));
        } else if path.extension().is_some_and(|end| end == "html") && entry.file_name() != NOT_FOUND {
            files.push(path);
        }
    }
    files
}

/// The values of these attributes in all tags; text and scripts are not looked at.
fn attributes(html: &str, names: &[&str]) -> BTreeSet<String> {
    let mut values = BTreeSet::new();
    let mut rest = html;
    while let Some(start) = rest.find('<') {
        rest = &rest[start + 1..];
        let name: String = rest.chars().take_while(char::is_ascii_alphanumeric).collect();
        let Some(end) = rest.find('>') else { break };
        let tag = &rest[..end];
        for attribute in names {
            let begin = format!(" {attribute}=\"");
            if let Some(at) = tag.find(&begin)
                && let Some(value) = tag[at + begin.len()..].split('"').next()
            {
                values.insert(value.replace("&amp;", "&"));
            }
        }
        rest = &rest[end + 1..];
        if name == "script" || name == "style" {
            let close = format!("</{name}");
            rest = rest.find(&close).map_or("", |at| &rest[at..]);
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_those_of_tags() {
        let html = r#"<a class="x" href="b.html#c&amp;d">href="no"</a><script src="s.js">let a = '<a href="no">';</script><h2 id="i">"#;
        assert_eq!(Vec::from_iter(attributes(html, &["href", "src"])), ["b.html#c&d", "s.js"]);
        assert_eq!(Vec::from_iter(attributes(html, &["id"])), ["i"]);
    }

    #[test]
    fn dead_files_and_anchors_are_found() {
        let site = std::env::temp_dir().join(format!("canter-xtask-links-{}", std::process::id()));
        fs::create_dir_all(site.join("in")).unwrap();
        let page = r#"<h1 id="here"><a href="in/b.html#there">.</a><a href="https://else.where/x">.</a>"#;
        fs::write(site.join("a.html"), page).unwrap();
        fs::write(site.join("in/b.html"), r##"<p id="there"><a href="../a.html#here">.</a><a href="#there">.</a>"##)
            .unwrap();
        let Ok(checked) = check(&site) else { panic!("dead") };
        assert_eq!((checked.pages, checked.links), (2, 3));

        fs::write(site.join("in/b.html"), r##"<a href="../a.html#gone">.</a><a href="c.html">.</a>"##).unwrap();
        let Err(Failure::Task(message)) = check(&site) else { panic!("accepted") };
        fs::remove_dir_all(&site).unwrap();
        for dead in ["`in/b.html#there`: that page", "`../a.html#gone`: that page", "`c.html`: there is no"] {
            assert!(message.contains(dead), "{message}");
        }
    }
}
