//! `visavis quantize`, run as a program.

#[path = "common/cli.rs"]
mod cli;

use cli::{Scratch, fails, names, succeeds};

#[test]
fn the_command_writes_whole_files_only() {
    let dir = Scratch::new("quantise");
    let tiny = "tests/goldens/tiny.safetensors";
    let out = dir.path("i8.safetensors");
    let text = succeeds(&["quantize", tiny, out.to_str().unwrap(), "--scheme", "i8", "--keep", "*.fc1=f32"]);
    assert!(text.contains("MB"), "{text}");
    assert!(succeeds(&["inspect", out.to_str().unwrap()]).contains("quantised to i8"));

    let again = dir.path("again.safetensors");
    fails(1, &["quantize", out.to_str().unwrap(), again.to_str().unwrap(), "--scheme", "i8"]);
    fails(1, &["quantize", out.to_str().unwrap(), out.to_str().unwrap(), "--scheme", "i4"]);
    fails(1, &["quantize", "no/such.safetensors", again.to_str().unwrap(), "--scheme", "i8"]);
    fails(2, &["quantize", tiny, again.to_str().unwrap(), "--scheme", "i3"]);
    fails(2, &["quantize", tiny, again.to_str().unwrap(), "--scheme", "i8", "--auto", "-1"]);
    fails(1, &["quantize", tiny, dir.path("no/folder/x").to_str().unwrap(), "--scheme", "i8"]);
    assert_eq!(names(dir.path("i8.safetensors").parent().unwrap()), ["i8.safetensors"]);
}
