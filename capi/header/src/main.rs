//! Makes `capi/include/visavis.h` from the code of the C interface: `cargo run -p visavis-header`. Its test tells when that is due.
//!
//! The generator's version is pinned in Cargo.toml, so the text depends on the code alone. A crate of its own: what the generator
//! depends on stays out of the library's build.

use std::path::{Path, PathBuf};

fn capi() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn header() -> Vec<u8> {
    let root = capi();
    let mut config = cbindgen::Config::from_file(root.join("cbindgen.toml")).expect("cbindgen.toml");
    config.header = Some(std::fs::read_to_string(root.join("header.txt")).expect("header.txt"));
    // The modules follow from the root.
    let builder = cbindgen::Builder::new().with_config(config).with_src(root.join("src/lib.rs"));
    let mut text = Vec::new();
    builder.generate().expect("a header").write(&mut text);
    text
}

fn main() {
    std::fs::write(capi().join("include/visavis.h"), header()).expect("written");
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_header_is_what_the_code_says() {
        let there = std::fs::read(super::capi().join("include/visavis.h")).expect("include/visavis.h");
        assert!(there == super::header(), "the header is out of date: run `cargo run -p visavis-header` and commit it");
    }
}
