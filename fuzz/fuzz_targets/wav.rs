//! Any bytes as a sound: finite samples, or a typed error.
#![no_main]

use libfuzzer_sys::fuzz_target;
use visavis::ErrorKind;
use visavis_tools::offline::Wav;

fuzz_target!(|data: &[u8]| match Wav::parse(data) {
    Ok(wav) => {
        assert!(wav.samples.len() <= data.len(), "no more samples than bytes");
        assert!(wav.samples.iter().all(|s| s.is_finite()));
        let resampled = wav.to_24k().expect("a rate that was checked");
        assert!(resampled.iter().all(|s| s.is_finite()));
    }
    Err(e) => assert_eq!(e.kind(), ErrorKind::Audio),
});
