//! Layouts without padding, and the same in C# (`unity/Runtime`).

use std::mem::{align_of, size_of};
use visavis_c::{VisavisFrame, VisavisJoint, VisavisSessionOptions, VisavisStats, VisavisVoiceStats};

fn csharp(file: &str) -> String {
    let path = format!("{}/unity/Runtime/{file}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(path).expect("a file of the package")
}

/// Fields of a struct in the C# file, `(type, name)`, in order.
fn fields(source: &str, name: &str) -> Vec<(String, String)> {
    let body = source.split(&format!("struct {name}\n")).nth(1).unwrap_or_else(|| panic!("no struct {name}"));
    let body = body.split('}').next().expect("a body");
    let fields = body.lines().filter_map(|l| l.trim().strip_prefix("public ")?.strip_suffix(';'));
    fields
        .flat_map(|f| {
            let (kind, names) = f.split_once(' ').expect("type and name");
            names.split(", ").map(|n| (kind.to_owned(), n.to_owned())).collect::<Vec<_>>()
        })
        .collect()
}

/// Size of a C# struct with sequential layout, which must have no padding.
fn csharp_size(source: &str, name: &str) -> usize {
    let mut offset = 0;
    for (kind, field) in fields(source, name) {
        let (size, align) = match kind.as_str() {
            "ulong" | "double" => (8, 8),
            "uint" | "int" | "float" => (4, 4),
            other => (csharp_size(source, other), 8),
        };
        assert_eq!(offset % align, 0, "padding before {name}.{field}");
        offset += size;
    }
    offset
}

#[cfg(not(feature = "grown"))]
#[test]
fn structs_have_no_padding_and_csharp_has_the_same() {
    let source = csharp("Structs.cs");
    for (name, size) in [
        ("SessionOptions", size_of::<VisavisSessionOptions>()),
        ("Frame", size_of::<VisavisFrame>()),
        ("Joint", size_of::<VisavisJoint>()),
        ("VoiceStats", size_of::<VisavisVoiceStats>()),
        ("Stats", size_of::<VisavisStats>()),
    ] {
        assert_eq!(csharp_size(&source, name), size, "{name}");
    }
    assert_eq!((align_of::<VisavisFrame>(), align_of::<VisavisJoint>()), (8, 4));
}

/// Every function of the header is in the C# file and the other way round, and every status has its
/// number.
#[test]
fn csharp_has_the_functions_and_numbers_of_the_header() {
    let root = env!("CARGO_MANIFEST_DIR");
    let (source, structs) = (csharp("Native.cs"), csharp("Structs.cs"));
    let header = std::fs::read_to_string(format!("{root}/include/visavis.h")).expect("visavis.h");
    let names = |text: &str, code: fn(&str) -> bool| {
        let mut names: Vec<String> = (text.lines().filter(|l| code(l)))
            .flat_map(|l| {
                l.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
                    .zip(l.split_inclusive(|c: char| !(c.is_ascii_alphanumeric() || c == '_')))
            })
            .filter(|(word, with)| word.starts_with("visavis_") && with.ends_with('('))
            .map(|(word, _)| word.to_owned())
            .collect();
        names.sort_unstable();
        names.dedup();
        names
    };
    let (c, cs) = (
        names(&header, |l| !l.trim_start().starts_with("//") && !l.starts_with(" *")),
        names(&source, |l| l.contains("extern")),
    );
    assert!(c.len() > 30, "{c:?}");
    assert_eq!(c, cs);
    for (rust, number) in
        [("ARGUMENT", 1), ("BUNDLE_CORRUPT", 3), ("AUDIO", 6), ("BUSY", 9), ("PANIC", 11), ("OTHER", 12)]
    {
        assert!(header.contains(&format!("VISAVIS_STATUS_{rust} = {number},")), "{rust}");
        let name: String = rust.split('_').map(|w| w[..1].to_owned() + &w[1..].to_lowercase()).collect();
        assert!(structs.contains(&format!("{name} = {number},")), "{name}");
    }
    assert!(source.contains(&format!("AbiVersion = 0x{:x};", visavis_c::VISAVIS_ABI_VERSION)));
}
