//! Any bytes as a bundle: an engine that runs, or a typed error.
#![no_main]

use libfuzzer_sys::fuzz_target;
use visavis_tools::contents::Contents;
use visavis::{BundleFile, Engine, Sampler, SessionOptions};
use visavis_fuzz::seed_small;

fuzz_target!(init: seed_small(), |data: &[u8]| {
    let contents = Contents::of(&BundleFile::from_bytes(data.to_vec(), "fuzz"));
    if let Ok(contents) = &contents {
        let _ = contents.to_string();
    }
    if let Ok(engine) = Engine::from_bytes(data.to_vec(), "fuzz") {
        assert!(contents.is_ok(), "what loads can be inspected");
        // The sampler that costs least; a bundle without a student has the other.
        let session = |sampler| engine.session(SessionOptions { sampler, ..Default::default() });
        if let Ok(mut session) = session(Sampler::Single).or_else(|_| session(Sampler::euler(1).expect("one step"))) {
            let frames = session.poll(0.0).expect("guarded").expect("due");
            assert!(frames.iter().flat_map(|f| &f.global).all(|t| t.position.is_finite() && t.rotation.is_finite()));
        }
    }
});
