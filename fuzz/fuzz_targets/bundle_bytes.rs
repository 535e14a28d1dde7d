//! Any bytes as a bundle: an engine that runs, or a typed error.
#![no_main]

use libfuzzer_sys::fuzz_target;
use visavis::bundle::{BundleFile, Contents};
use visavis::engine::Engine;
use visavis::session::SessionOptions;

fuzz_target!(|data: &[u8]| {
    let contents = Contents::of(&BundleFile::from_bytes(data.to_vec(), "fuzz"));
    if let Ok(contents) = &contents {
        let _ = contents.to_string();
    }
    if let Ok(engine) = Engine::from_bytes(data.to_vec(), "fuzz") {
        assert!(contents.is_ok(), "what loads can be inspected");
        if let Ok(mut session) = engine.session(SessionOptions::default()) {
            let frames = session.poll(0.0).expect("guarded").expect("due");
            assert!(frames.iter().flat_map(|f| &f.global).all(|t| t.position.is_finite() && t.rotation.is_finite()));
        }
    }
});
