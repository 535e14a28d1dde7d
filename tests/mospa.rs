//! Bundles of the kind `mospa`: what is refused when they are opened, and where.

use visavis::internals::kernels::Kernels;
use visavis::internals::mospa::Reactor;
use visavis::{BundleFile, Engine, ErrorKind};

const BUNDLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/goldens/mospa.safetensors");

/// The tiny bundle with `from` in its config replaced by the equally long `to`.
fn changed(from: &str, to: &str) -> Vec<u8> {
    let mut bytes = std::fs::read(BUNDLE).unwrap();
    let (from, to) = (from.replace('"', "\\\""), to.replace('"', "\\\""));
    assert_eq!(from.len(), to.len());
    let at = bytes.windows(from.len()).position(|part| part == from.as_bytes()).expect("it is in the config");
    bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    bytes
}

#[test]
fn sizes_out_of_range_are_refused_before_any_tensor_is_read() {
    for (from, to) in [
        ("\"frames\": 16", "\"frames\": 15"),
        ("\"frames\": 16", "\"frames\": 08"),
        ("\"frames\": 16", "\"frames\":  8"),
        ("\"patch\": 2", "\"patch\": 0"),
        ("\"width\": 16", "\"width\": 18"),
        ("\"heads\": 2", "\"heads\": 0"),
        ("\"heads\": 2", "\"heads\": 3"),
        ("\"layers\": 2", "\"layers\": 0"),
        ("\"mlp\": 2", "\"mlp\": 0"),
        ("\"mlp\": 2", "\"mpl\": 2"),
        ("\"diffusion_steps\": 1000", "\"diffusion_steps\": 9999"),
        ("\"kind\": \"mospa\"", "\"kind\": \"opera\""),
    ] {
        let bytes = changed(from, to);
        let e = BundleFile::from_bytes(bytes, "changed").parse().map(drop).expect_err(to);
        assert_eq!(e.kind(), ErrorKind::BundleInvalid, "{to}: {e}");
        assert!(e.to_string().starts_with("changed: "), "{e}");
    }
    // In range, but not what the tensors are.
    let bytes = changed("\"width\": 16", "\"width\": 32");
    let e = Reactor::load(&BundleFile::from_bytes(bytes, "changed"), Kernels::detect().unwrap()).unwrap_err();
    assert_eq!(e.kind(), ErrorKind::BundleInvalid, "{e}");
}

#[test]
fn a_bundle_without_sessions_is_refused_by_the_engine_and_says_what_runs_it() {
    let e = Engine::load(BUNDLE).map(drop).unwrap_err();
    assert_eq!(e.kind(), ErrorKind::Argument);
    assert!(e.to_string().contains("visavis react"), "{e}");
    assert!(e.path().is_some_and(|path| path.ends_with("mospa.safetensors")));
}
