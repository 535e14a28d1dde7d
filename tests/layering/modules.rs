//! The modules of a crate and the paths between them, read from its source.
//!
//! Files are read as tokens, so comments and strings do not count and what macros are given does.
//! `crate`, `super` and `self` are resolved from the module that they stand in, inline modules and
//! `#[path]` included, and names that a module takes up from another (`use`, `pub use`) are
//! followed to where they come from.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What marks code that is in no library that is shipped.
const FOR_TESTS: [&str; 2] = ["[cfg(test)]", "[cfg(any(test,feature=\"kernel-tests\"))]"];

/// A module by its path from the crate's root: `["kernels", "attend"]`.
pub type Module = Vec<String>;

/// A crate's modules.
#[derive(Default)]
pub struct Modules {
    /// What each module takes up under a name of its own: paths from the crate's root.
    names: BTreeMap<Module, BTreeMap<String, Module>>,
    /// Each path and the module that it stands in.
    paths: Vec<(Module, Module)>,
    /// Modules that are compiled for tests alone.
    tests: BTreeSet<Module>,
    /// Paths that end at the crate's root: the front door, which is for guests.
    root_globs: Vec<Module>,
}

impl Modules {
    /// The crate whose root is the file `root`.
    pub fn read(root: &Path) -> Self {
        let mut modules = Self::default();
        let folder = root.parent().expect("a folder").to_path_buf();
        modules.file(root, Vec::new(), folder);
        modules
    }

    /// `folder`: where this module's children have their files.
    fn file(&mut self, path: &Path, module: Module, folder: PathBuf) {
        let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let tokens: TokenStream = text.parse().unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        self.names.entry(module.clone()).or_default();
        self.tokens(tokens, &module, &folder, path.parent().expect("a folder"));
    }

    /// `beside`: the folder of the file itself, which `#[path]` counts from.
    fn tokens(&mut self, tokens: TokenStream, module: &Module, folder: &Path, beside: &Path) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let (mut i, mut path_attribute, mut for_tests) = (0, None, false);
        while i < tokens.len() {
            match word(tokens.get(i)).as_deref() {
                Some("pub") if matches!(tokens.get(i + 1), Some(TokenTree::Group(_))) => i += 2,
                Some("mod") if word(tokens.get(i + 1)).is_some() => {
                    let name = word(tokens.get(i + 1)).expect("a name");
                    let child = [module.clone(), vec![name.clone()]].concat();
                    let given: Option<PathBuf> = path_attribute.take();
                    if std::mem::take(&mut for_tests) || self.tests.contains(module) {
                        self.tests.insert(child.clone());
                    }
                    match tokens.get(i + 2) {
                        Some(TokenTree::Group(body)) => {
                            self.names.entry(child.clone()).or_default();
                            self.tokens(body.stream(), &child, &folder.join(&name), &folder.join(&name));
                        }
                        _ => {
                            let flat = folder.join(format!("{name}.rs"));
                            let file = given.map(|p| beside.join(p)).unwrap_or(flat);
                            let file = if file.exists() { file } else { folder.join(&name).join("mod.rs") };
                            self.file(&file, child, folder.join(&name));
                        }
                    }
                    i += 3;
                }
                Some("use") => {
                    let end = (i..tokens.len()).find(|j| punct(tokens.get(*j), ';')).expect("a use ends");
                    let mut items = Vec::new();
                    tree(&tokens[i + 1..end], &[], &mut items);
                    items.into_iter().for_each(|(path, name)| self.taken_up(module, path, name));
                    (i, for_tests) = (end + 1, false);
                }
                Some("crate" | "super" | "self") if follows(&tokens, i) => {
                    let mut path = vec![word(tokens.get(i)).expect("a word")];
                    while follows(&tokens, i) && word(tokens.get(i + 3)).is_some() {
                        path.extend(word(tokens.get(i + 3)));
                        i += 3;
                    }
                    if let Some(path) = absolute(module, &path) {
                        self.paths.push((module.clone(), path));
                    }
                    i += 1;
                }
                _ => {
                    for_tests &= !punct(tokens.get(i), ';');
                    if let Some(TokenTree::Group(group)) = tokens.get(i) {
                        path_attribute = path_of(group.stream()).or(path_attribute);
                        // An attribute is for the item that follows, which a body ends.
                        let body = group.delimiter() == Delimiter::Brace;
                        for_tests = !body && (for_tests || FOR_TESTS.contains(&&*group.to_string().replace(' ', "")));
                        self.tokens(group.stream(), module, folder, beside);
                    }
                    i += 1;
                }
            }
        }
    }

    fn taken_up(&mut self, module: &Module, path: Vec<String>, name: String) {
        let Some(path) = absolute(module, &path) else {
            // `use child::Name`, or another crate.
            let local = [module.clone(), path.clone()].concat();
            self.names.entry(module.clone()).or_default().insert(name, local);
            return;
        };
        if name == "*" && path.is_empty() {
            self.root_globs.push(module.clone());
        }
        self.paths.push((module.clone(), path.clone()));
        self.names.entry(module.clone()).or_default().insert(name, path);
    }

    /// The module that `path` leads to: down through modules, and through the names that they took
    /// up.
    fn target(&self, path: &[String], depth: usize) -> Module {
        let mut at = Module::new();
        for (i, segment) in path.iter().enumerate() {
            let below = [at.clone(), vec![segment.clone()]].concat();
            if self.names.contains_key(&below) {
                at = below;
                continue;
            }
            let Some(from) = self.names.get(&at).and_then(|names| names.get(segment)) else { break };
            let first = [at.clone(), vec![from.get(at.len()).cloned().unwrap_or_default()]].concat();
            let known = from.len() > at.len() && from.starts_with(&at) && self.names.contains_key(&first);
            if depth < 8 && (known || self.names.contains_key(&from[..1.min(from.len())])) {
                return self.target(&[from, &path[i + 1..]].concat(), depth + 1);
            }
            break;
        }
        at
    }

    /// Who uses whom among the direct children of `parent`, names followed to where they come from,
    /// tests aside. At the root tests count, and the first module that is named, so that a room
    /// which passes a name on is the one that is used.
    pub fn arrows(&self, parent: &[String]) -> BTreeSet<(String, String)> {
        let mut arrows = BTreeSet::new();
        let counts = |from: &Module| from.starts_with(parent) && (parent.is_empty() || !self.tests.contains(from));
        for (from, path) in self.paths.iter().filter(|(from, _)| counts(from)) {
            let to = match parent {
                [] => path.clone(),
                _ => self.target(path, 0),
            };
            if let (Some(a), true, Some(b)) = (from.get(parent.len()), to.starts_with(parent), to.get(parent.len()))
                && a != b
            {
                arrows.insert((a.clone(), b.clone()));
            }
        }
        arrows
    }

    /// Modules with children, the root included.
    pub fn parents(&self) -> BTreeSet<Module> {
        self.names.keys().filter(|m| !m.is_empty()).map(|m| m[..m.len() - 1].to_vec()).collect()
    }

    /// Modules that take everything from the crate's root.
    pub fn root_globs(&self) -> &[Module] {
        &self.root_globs
    }
}

/// A way around in `arrows`, if there is one: each uses the next, and the last is the first.
pub fn circle(arrows: &BTreeSet<(String, String)>) -> Option<Vec<String>> {
    let mut left = arrows.clone();
    // Who uses nobody, or is used by nobody, is on no circle.
    loop {
        let before = left.len();
        let (from, to): (BTreeSet<_>, BTreeSet<_>) = left.iter().cloned().unzip();
        left.retain(|(a, b)| from.contains(b) && to.contains(a));
        if left.len() == before {
            break;
        }
    }
    let mut way = vec![left.first()?.0.clone()];
    loop {
        let next = left.iter().find(|(a, _)| Some(a) == way.last()).map(|(_, b)| b.clone())?;
        if let Some(start) = way.iter().position(|m| *m == next) {
            way.push(next);
            return Some(way.split_off(start));
        }
        way.push(next);
    }
}

/// `path` from the crate's root; `None` where it starts with a name instead.
fn absolute(module: &Module, path: &[String]) -> Option<Module> {
    let (mut at, mut rest) = match path.first()?.as_str() {
        "crate" => (Module::new(), &path[1..]),
        "self" => (module.clone(), &path[1..]),
        "super" => (module.clone(), path),
        _ => return None,
    };
    while rest.first().is_some_and(|s| s == "super") {
        at.pop();
        rest = &rest[1..];
    }
    Some([&at[..], rest].concat())
}

/// The paths of a use tree and the names that they get.
fn tree(tokens: &[TokenTree], prefix: &[String], items: &mut Vec<(Vec<String>, String)>) {
    let (mut path, mut i) = (prefix.to_vec(), 0);
    while i < tokens.len() {
        match &tokens[i] {
            TokenTree::Ident(ident) if ident == "as" => {
                items.push((path.clone(), word(tokens.get(i + 1)).unwrap_or_default()));
                return;
            }
            TokenTree::Ident(ident) if ident == "self" && !path.is_empty() => {}
            TokenTree::Ident(ident) => path.push(ident.to_string()),
            TokenTree::Punct(p) if p.as_char() == '*' => {
                items.push((path, "*".to_owned()));
                return;
            }
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                let inner: Vec<_> = group.stream().into_iter().collect();
                inner
                    .split(|t| punct(Some(t), ','))
                    .filter(|part| !part.is_empty())
                    .for_each(|p| tree(p, &path, items));
                return;
            }
            _ => {}
        }
        i += 1;
    }
    if let Some(name) = path.last().cloned() {
        items.push((path, name));
    }
}

/// The file that `#[path = "..."]` names.
fn path_of(attribute: TokenStream) -> Option<PathBuf> {
    let tokens: Vec<_> = attribute.into_iter().collect();
    (word(tokens.first())? == "path").then(|| tokens.get(2).map(|t| PathBuf::from(t.to_string().trim_matches('"'))))?
}

fn word(token: Option<&TokenTree>) -> Option<String> {
    match token? {
        TokenTree::Ident(ident) => Some(ident.to_string()),
        _ => None,
    }
}

fn punct(token: Option<&TokenTree>, c: char) -> bool {
    matches!(token, Some(TokenTree::Punct(p)) if p.as_char() == c)
}

/// Whether `::` stands after token `i`.
fn follows(tokens: &[TokenTree], i: usize) -> bool {
    punct(tokens.get(i + 1), ':') && punct(tokens.get(i + 2), ':')
}
