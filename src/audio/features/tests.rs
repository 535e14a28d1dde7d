use super::*;
use safetensors::SafeTensors;

/// Columns and what they are.
const PARTS: [(&str, std::ops::Range<usize>); 8] = [
    ("MFCC", 0..20),
    ("deltas", 20..40),
    ("constant-Q chroma", 40..52),
    ("STFT chroma", 52..64),
    ("onset strength", 64..65),
    ("tempogram", 65..129),
    ("beats", 129..130),
    ("RMS and activity", 130..132),
];

fn golden() -> (Vec<f64>, Vec<f32>) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/goldens/mospa.out.safetensors");
    let bytes = std::fs::read(path).unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let sound = file.tensor("sound").unwrap();
    let sound = sound.data().as_chunks::<2>().0.iter().map(|b| f64::from(i16::from_le_bytes(*b)) / 32768.0).collect();
    let features = file.tensor("features").unwrap();
    (sound, features.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect())
}

#[test]
fn features_are_those_of_librosa() {
    let (sound, wanted) = golden();
    let found = ear(&sound).unwrap();
    assert_eq!(found.len(), wanted.len());
    assert!(wanted.iter().skip(129).step_by(SIZE).sum::<f32>() >= 3.0, "the golden has beats");
    assert!(found.iter().chain(&wanted).all(|v| v.is_finite()));
    for (name, columns) in PARTS {
        let rows = found.chunks_exact(SIZE).zip(wanted.chunks_exact(SIZE));
        let errors =
            rows.flat_map(|(a, b)| a[columns.clone()].iter().zip(&b[columns.clone()]).map(|(a, b)| (a - b).abs()));
        let error = errors.fold(0.0, f32::max);
        assert!(error < 1e-4, "{name}: {error}");
    }
}

#[test]
fn silence_has_finite_features_and_no_beats() {
    let found = ear(&vec![0.0; 40 * HOP]).unwrap();
    assert_eq!(found.len(), 40 * SIZE);
    assert!(found.iter().all(|v| v.is_finite()));
    for row in found.chunks_exact(SIZE) {
        assert!(row[40..].iter().all(|v| *v == 0.0), "no chroma, onset, tempo, beat or energy");
    }
}

#[test]
fn clicks_of_two_a_second_are_beats_of_two_a_second() {
    let mut y = vec![0.0; 240 * HOP];
    for at in (3 * HOP..y.len()).step_by(15 * HOP) {
        for i in 0..400.min(y.len() - at) {
            y[at + i] = 0.5 * libm::exp(-(i as f64) / 80.0) * libm::sin((i * i) as f64);
        }
    }
    let found = ear(&y).unwrap();
    let beats: Vec<usize> = (0..240).filter(|t| found[t * SIZE + 129] == 1.0).collect();
    assert!(beats.len() >= 12, "{beats:?}");
    // The last one has only half of its surroundings.
    let inner = &beats[..beats.len() - 1];
    assert!(inner.windows(2).all(|pair| pair[1] - pair[0] == 15), "{beats:?}");
}

#[test]
fn too_short_and_not_numbers_are_typed_errors() {
    assert_eq!(ear(&[]).unwrap_err().kind(), ErrorKind::Audio);
    assert_eq!(ear(&vec![0.1; 9 * HOP - 1]).unwrap_err().kind(), ErrorKind::Audio);
    let mut y = vec![0.1; 9 * HOP];
    assert!(ear(&y).is_ok());
    y[17] = f64::NAN;
    let e = ear(&y).unwrap_err();
    assert!(e.kind() == ErrorKind::Audio && e.to_string().contains("17"), "{e}");
}
