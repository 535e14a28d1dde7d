//! Makes `capi/include/visavis.h` from the code of the C interface: `cargo run -p visavis-header`.
//! Its test tells when that is due. With the name of a file it writes there the header of the next
//! version, which is that of the library with the feature `grown`.
//!
//! The generator's version is pinned in Cargo.toml, so the text depends on the code alone. A crate
//! of its own: what the generator depends on stays out of the library's build.

use std::path::{Path, PathBuf};

fn capi() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// What cbindgen makes of fields that are there with a feature only.
const GROWN: &str = "#if defined(VISAVIS_GROWN)";

fn header(grown: bool) -> String {
    let root = capi();
    let mut config = cbindgen::Config::from_file(root.join("cbindgen.toml")).expect("cbindgen.toml");
    config.header = Some(std::fs::read_to_string(root.join("header.txt")).expect("header.txt"));
    // The modules follow from the root.
    let builder = cbindgen::Builder::new().with_config(config).with_src(root.join("src/lib.rs"));
    let mut text = Vec::new();
    builder.generate().expect("a header").write(&mut text);
    let text = String::from_utf8(text).expect("UTF-8");
    let (mut kept, mut lines) = (String::new(), text.split_inclusive('\n'));
    while let Some(line) = lines.next() {
        if line.trim_end() != GROWN {
            kept += line;
            continue;
        }
        let field: String = lines.by_ref().take_while(|line| line.trim_end() != "#endif").collect();
        assert_eq!(lines.next().map(str::trim), Some(";"), "after a field");
        if grown {
            kept += &format!("{};\n", field.trim_end());
        }
    }
    kept
}

fn main() {
    match std::env::args_os().nth(1) {
        None => std::fs::write(capi().join("include/visavis.h"), header(false)),
        Some(file) => std::fs::write(file, header(true)),
    }
    .expect("written");
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_header_is_what_the_code_says() {
        let there = std::fs::read_to_string(super::capi().join("include/visavis.h")).expect("include/visavis.h");
        let (now, next) = (super::header(false), super::header(true));
        assert!(there == now, "the header is out of date: run `cargo run -p visavis-header` and commit it");
        assert!(!now.contains("GROWN") && !now.contains("grown;"));
        assert!(!next.contains("GROWN") && next.matches(" grown;").count() == 3);
    }
}
