//! Any text as a user's path: ascending times and near positions, or a typed error.
#![no_main]

use libfuzzer_sys::fuzz_target;
use visavis::ErrorKind;
use visavis_tools::offline::UserPath;
use visavis_tools::offline::{Conversation, for_session};

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    match UserPath::parse(text) {
        Ok(path) => {
            let points = path.points();
            assert!(!points.is_empty() && points.windows(2).all(|w| w[0].0 < w[1].0));
            assert!(points.iter().all(|(t, p)| t.is_finite() && p.is_finite() && p.length() < 1100.0));
            path.at(points[0].0 + 0.1);
            // Filling in is bounded by the length that a conversation may have.
            if let Ok(talk) = Conversation::new(None, None, Some(path)) {
                let filled = talk.path().map(for_session).unwrap_or_default();
                assert!(filled.windows(2).all(|w| w[0].0 < w[1].0));
            }
        }
        Err(e) => assert_eq!(e.kind(), ErrorKind::UserPath),
    }
});
