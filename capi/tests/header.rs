//! `include/visavis.h` is what the code says. `VISAVIS_HEADER=write cargo test -p visavis-capi --test header` rewrites it.
//!
//! The generator's version is pinned in Cargo.toml, so the text depends on the code alone.

use std::path::Path;

#[test]
fn the_header_is_what_the_code_says() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut config = cbindgen::Config::from_file(root.join("cbindgen.toml")).expect("cbindgen.toml");
    config.header = Some(std::fs::read_to_string(root.join("header.txt")).expect("header.txt"));
    let bindings = cbindgen::Builder::new()
        .with_config(config)
        .with_src(root.join("src/lib.rs"))
        .with_src(root.join("src/status.rs"))
        .with_src(root.join("src/engine.rs"))
        .with_src(root.join("src/options.rs"))
        .with_src(root.join("src/session.rs"))
        .with_src(root.join("src/frames.rs"))
        .with_src(root.join("src/stats.rs"))
        .with_src(root.join("src/threads.rs"))
        .generate()
        .expect("a header");
    let mut text = Vec::new();
    bindings.write(&mut text);
    let path = root.join("include/visavis.h");
    if std::env::var("VISAVIS_HEADER").is_ok_and(|v| v == "write") {
        std::fs::write(&path, &text).expect("written");
    }
    let there = std::fs::read_to_string(&path).expect("include/visavis.h");
    assert!(there.as_bytes() == text, "the header is out of date: run with VISAVIS_HEADER=write and commit it");
}
