//! Who may use whom: the rooms of the library from the ground up, and no circles among the files of
//! a room.

mod modules;

use modules::{Modules, circle};
use std::collections::BTreeSet;
use std::path::Path;

/// A room, what it is for, and the rooms that it uses. Each stands above those that it uses, so
/// there is no circle. Tests in `src/` keep to it as well.
const ROOMS: &[(&str, &str, &[&str])] = &[
    ("error", "the one error type", &[]),
    ("bounded", "reading files, never more than was agreed", &[]),
    ("clock", "when a block began, and how long it took", &[]),
    ("frame", "what passes between stages and to the caller", &["error"]),
    ("queue", "records between threads that do not wait", &[]),
    ("scheme", "how weights are stored", &[]),
    ("rig", "the skeleton", &["error", "frame"]),
    ("normaliser", "the networks' scale and that of metres", &["error"]),
    ("config", "what a bundle says about itself", &["rig", "scheme"]),
    ("par", "two threads", &["clock", "error"]),
    ("kernels", "arithmetic", &["error", "par", "scheme"]),
    ("user", "the user's head", &["frame", "queue"]),
    ("audio", "voices", &["config", "error", "frame", "kernels", "queue"]),
    ("pose", "features to joints and back", &["error", "frame", "kernels", "normaliser", "par", "rig"]),
    ("bundle", "the model file", &["audio", "bounded", "config", "error", "frame", "kernels"]),
    ("nn", "transformer layers and LSTM cells", &["bundle", "error", "kernels"]),
    ("vae", "motion to latents and back", &["bundle", "config", "error", "frame", "kernels", "nn", "normaliser"]),
    ("flow", "noise to latents", &["bundle", "config", "error", "frame", "kernels", "nn", "normaliser"]),
    ("hearing", "sounds in the room", &["audio", "bundle", "config", "error", "frame", "kernels", "nn", "queue"]),
    ("dram", "steps of the featherweight tier", &["bundle", "config", "error", "frame", "kernels", "nn", "rig"]),
    (
        "mospa",
        "reactions to whole clips of sound",
        &["audio", "bundle", "config", "error", "flow", "frame", "kernels", "nn", "normaliser", "rig"],
    ),
    (
        "engine",
        "a loaded bundle",
        &[
            "audio",
            "bundle",
            "config",
            "dram",
            "error",
            "flow",
            "frame",
            "hearing",
            "kernels",
            "normaliser",
            "pose",
            "rig",
            "vae",
        ],
    ),
    (
        "session",
        "one conversation",
        &[
            "audio",
            "clock",
            "config",
            "dram",
            "engine",
            "error",
            "flow",
            "frame",
            "hearing",
            "kernels",
            "normaliser",
            "par",
            "pose",
            "user",
            "vae",
        ],
    ),
    (
        "quant",
        "smaller bundles",
        &["bundle", "config", "engine", "error", "frame", "kernels", "mospa", "normaliser", "pose", "session", "vae"],
    ),
];

/// Modules of `src/lib.rs` itself: the front door, which lets names out. No room goes through it.
const FRONT: &[&str] = &["internals", "openxr", "replay", "stats", "threads"];

fn library() -> Modules {
    Modules::read(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src/lib.rs")))
}

/// What is wrong with the arrows between rooms, a line each.
fn complaints(arrows: &BTreeSet<(String, String)>) -> Vec<String> {
    let place = |room: &str| ROOMS.iter().position(|(name, ..)| *name == room);
    let mut wrong = Vec::new();
    for (from, to) in arrows.iter().filter(|(from, _)| !FRONT.contains(&from.as_str())) {
        match (place(from), place(to)) {
            (Some(a), Some(_)) if ROOMS[a].2.contains(&to.as_str()) => {}
            (Some(_), Some(_)) => wrong.push(format!("{from} uses {to}, which the table does not say")),
            (Some(_), None) => wrong.push(format!("{from} uses crate::{to}: name the room that it is from")),
            (None, _) => wrong.push(format!("{from} is not in the table")),
        }
    }
    for (i, (from, _, rooms)) in ROOMS.iter().enumerate() {
        for to in *rooms {
            if place(to).is_none_or(|below| below >= i) {
                wrong.push(format!("the table has {from} use {to}, which does not stand below it"));
            }
            if !arrows.contains(&((*from).to_owned(), (*to).to_owned())) {
                wrong.push(format!("the table has {from} use {to}, and it does not"));
            }
        }
    }
    wrong
}

#[test]
fn rooms_use_those_below_them() {
    let modules = library();
    let wrong = complaints(&modules.arrows(&[]));
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(modules.root_globs(), &[] as &[modules::Module], "nobody takes everything from the front door");
}

#[test]
fn files_of_a_room_have_no_circles() {
    let modules = library();
    for parent in modules.parents().iter().filter(|p| !p.is_empty()) {
        let found = circle(&modules.arrows(parent));
        assert!(found.is_none(), "in {}: {}", parent.join("::"), found.unwrap_or_default().join(" -> "));
    }
}

/// A crate of these files, planted in a folder of its own.
fn planted(name: &str, files: &[(&str, &str)]) -> Modules {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("layering-{name}"));
    let _ = std::fs::remove_dir_all(&folder);
    for (file, text) in files {
        let path = folder.join(file);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, text).expect("a file");
    }
    Modules::read(&folder.join("lib.rs"))
}

fn pairs(arrows: &BTreeSet<(String, String)>) -> Vec<String> {
    arrows.iter().map(|(a, b)| format!("{a} {b}")).collect()
}

#[test]
fn arrows_are_seen_however_they_are_written() {
    let modules = planted(
        "paths",
        &[
            ("lib.rs", "mod a; mod b; mod c { pub fn f() { super::b::deep::g() } } mod d; mod e; mod f;"),
            (
                "a.rs",
                "use crate::{b::{self, deep}, c as other}; // crate::d\n/// [`crate::d`]\nfn f() { \"crate::d\"; }",
            ),
            ("b/mod.rs", "pub mod deep; #[path = \"odd.rs\"] mod even;"),
            ("b/deep.rs", "pub(in crate::b) fn g() { assert!(super::super::d::f() == 1) }"),
            ("b/odd.rs", "mod inner { use super::super::super::e; }"),
            ("d.rs", "pub fn f() -> u8 { 1 } #[cfg(test)] mod tests { use super::*; fn g() { crate::f::h() } }"),
            ("e.rs", "pub use crate::d::f; type T = <u8 as crate::a::Trait>::Out;"),
            ("f.rs", "macro_rules! m { () => { $crate::c::f() } }"),
        ],
    );
    let wanted = ["a b", "a c", "b d", "b e", "c b", "d f", "e a", "e d", "f c"];
    assert_eq!(pairs(&modules.arrows(&[])), wanted);
}

#[test]
fn names_are_followed_to_the_files_that_they_come_from() {
    let files = [
        ("lib.rs", "mod room;"),
        ("room/mod.rs", "mod a; mod b; pub use a::Thing; use b::{work as toil};"),
        (
            "room/a.rs",
            "use super::toil; pub struct Thing; fn f() { toil() } #[cfg(test)] mod tests { use super::super::b; }",
        ),
        ("room/b.rs", "pub fn work() -> crate::room::Thing { crate::room::Thing }"),
    ];
    let arrows = planted("names", &files).arrows(&["room".to_owned()]);
    assert_eq!(pairs(&arrows), ["a b", "b a"]);
    assert!(circle(&arrows).is_some_and(|way| way.len() == 3 && way.first() == way.last()));
    let apart = [
        files[0],
        files[1],
        ("room/a.rs", "#[cfg(test)] mod tests { use super::super::b; } pub struct Thing;"),
        files[3],
    ];
    assert_eq!(circle(&planted("apart", &apart).arrows(&["room".to_owned()])), None, "tests do not count");
}

/// The table's own guard: each kind of mistake is one line.
#[test]
fn planted_arrows_are_complained_about() {
    let arrow = |a: &str, b: &str| (a.to_owned(), b.to_owned());
    let mut arrows = library().arrows(&[]);
    for (bad, line) in [
        (arrow("engine", "session"), "engine uses session, which the table does not say"),
        (arrow("config", "kernels"), "config uses kernels, which the table does not say"),
        (arrow("pose", "Error"), "pose uses crate::Error: name the room that it is from"),
        (arrow("tools", "error"), "tools is not in the table"),
    ] {
        arrows.insert(bad.clone());
        assert_eq!(complaints(&arrows), [line]);
        arrows.remove(&bad);
    }
    arrows.remove(&arrow("user", "frame"));
    assert_eq!(complaints(&arrows), ["the table has user use frame, and it does not"]);
}
