//! What the texts promise about themselves: links lead somewhere, the crate's front page names all
//! that is public, the README is short.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Markdown files in `folder`, but for what builds leave there.
fn texts(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
        if entry.file_type().expect("a type").is_dir() {
            if !name.starts_with('.') && !["target", "out", "node_modules"].contains(&name.as_str()) {
                texts(&path, found);
            }
        } else if path.extension().is_some_and(|e| e == "md") {
            found.push(path);
        }
    }
}

/// A text without its fenced code.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    let mut code = false;
    text.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        code ^= fence;
        !code && !fence
    })
}

/// Where `[text](target)` points.
fn targets(text: &str) -> Vec<&str> {
    let lines = prose(text).flat_map(|line| line.split("](").skip(1));
    lines.filter_map(|rest| rest.split([')', ' ']).next()).collect()
}

/// The names by which a text's headings are linked to.
fn anchors(text: &str) -> BTreeSet<String> {
    let headings =
        prose(text).filter_map(|line| line.trim_start_matches('#').strip_prefix(' ').filter(|_| line.starts_with('#')));
    let slug = |heading: &str| -> String {
        let kept = heading.trim().to_lowercase().replace(' ', "-");
        kept.chars().filter(|c| c.is_alphanumeric() || "-_".contains(*c)).collect()
    };
    headings.map(slug).collect()
}

/// What is wrong with the links of these texts.
fn dead(texts: &BTreeMap<PathBuf, String>) -> Vec<String> {
    let mut wrong = Vec::new();
    for (file, text) in texts {
        for target in targets(text).into_iter().filter(|t| !t.contains("://") && !t.starts_with("mailto:")) {
            let (path, anchor) = target.split_once('#').map_or((target, None), |(path, anchor)| (path, Some(anchor)));
            let there = if path.is_empty() { file.clone() } else { file.parent().expect("a folder").join(path) };
            let complaint = match anchor {
                _ if !there.exists() => "is not there",
                Some(anchor) if !anchors(&read(&there)).contains(anchor) => "has no such heading",
                _ => continue,
            };
            wrong.push(format!("{}: {target} {complaint}", file.display()));
        }
    }
    wrong
}

#[test]
fn links_lead_somewhere() {
    let mut files = Vec::new();
    texts(&root(), &mut files);
    let mut texts: BTreeMap<PathBuf, String> = files.into_iter().map(|file| (file.clone(), read(&file))).collect();
    let links: usize = texts.values().map(|text| targets(text).len()).sum();
    assert!(links > 50, "{links} links in {} files", texts.len());
    assert_eq!(dead(&texts), [""; 0]);
    // And the check sees what is dead.
    let planted = "[a](none.md) [b](README.md#limits) [c](README.md#none)\n```\n[d](none)\n```\n[e](https://none)";
    texts = BTreeMap::from([(root().join("planted.md"), planted.to_owned())]);
    let wrong = dead(&texts);
    assert_eq!(wrong.len(), 2, "{wrong:?}");
    assert!(wrong[0].ends_with("none.md is not there") && wrong[1].ends_with("#none has no such heading"), "{wrong:?}");
}

/// The list of names stands before the tables that rustdoc makes, and fits on a screen where they do
/// not.
#[test]
fn the_front_page_names_all_that_is_public() {
    let lib = read(&root().join("src/lib.rs"));
    let (page, code): (Vec<&str>, Vec<&str>) = lib.lines().partition(|line| line.starts_with("//!"));
    let code = code.join("\n");
    let uses = code.split("\npub use ").skip(1).filter_map(|rest| rest.split_once(';')).map(|(path, _)| path);
    let names = uses.flat_map(|path| path.rsplit("::").next().unwrap_or(path).split([',', '{', '}']));
    let modules = code.split("\npub mod ").skip(1).filter_map(|rest| rest.split_once(' ')).map(|(name, _)| name);
    let mut public: BTreeSet<&str> = names.chain(modules).map(str::trim).filter(|name| !name.is_empty()).collect();
    assert!(public.remove("glam") && public.remove("internals") && public.len() > 20, "{public:?}");
    let page = page.join(" ");
    let missing: Vec<&&str> = public.iter().filter(|name| !page.contains(&format!("[`{name}`]"))).collect();
    assert!(missing.is_empty(), "not in the list of src/lib.rs: {missing:?}");
    assert_eq!(page.matches("[`").count(), public.len(), "the list names what is not public");
}

#[test]
fn the_readme_is_short() {
    let words = read(&root().join("README.md")).split_whitespace().count();
    assert!(words <= 1_000, "{words} words");
}
