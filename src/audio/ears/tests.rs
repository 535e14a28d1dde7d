use super::*;
use safetensors::SafeTensors;

/// Numbers in place of noise that every language computes alike.
fn plain(out: &mut [f64]) {
    out.iter_mut().enumerate().for_each(|(i, v)| *v = ((i * 37 % 101) as f64 - 50.0) / 29.0);
}

fn none(out: &mut [f64]) {
    out.fill(0.0);
}

fn click(at: usize) -> Vec<f32> {
    (0..4384).map(|i| if i == at { 0.5 } else { 0.0 }).collect()
}

/// Both ears in the open, no tail, no noise.
fn heard(sound: &[f32], place: [f64; 3]) -> [Vec<f64>; 2] {
    let (low, high) = ([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]);
    let open = Room { low, high, reflect: 0.0, fall: 0.1, tail: 0.0 };
    let mut ears = Ears::new(sound.len());
    ears.add(sound, 0, place, &open, &mut none).unwrap();
    ears.finish(f64::NEG_INFINITY, &mut none).0
}

fn loudest(ear: &[f64]) -> usize {
    (0..ear.len()).max_by(|a, b| ear[*a].abs().total_cmp(&ear[*b].abs())).unwrap()
}

#[test]
fn equals_the_rendering_of_the_corpus() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/goldens/mospa.ears.safetensors");
    let bytes = std::fs::read(path).unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let wanted = file.tensor("ears").unwrap();
    let wanted: Vec<f32> = wanted.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    let sound: Vec<f32> = (0..4384).map(|i| ((i * i % 251) as f32 - 125.0) / 250.0).collect();
    let source = [-1.5, 1.1, -2.0];
    let room = Room { low: [-2.5, 0.0, -3.5], high: [1.25, 2.75, 1.5], reflect: 0.5, fall: 0.125, tail: 0.02 };
    let mut ears = Ears::new(sound.len());
    ears.add(&sound, 0, source, &room, &mut plain).unwrap();
    let ([left, right], _) = ears.finish(40.0, &mut plain);
    assert_eq!(wanted.len(), 2 * sound.len());
    let errors = left.iter().chain(&right).zip(&wanted).map(|(a, b)| (a - f64::from(*b)).abs());
    let error = errors.fold(0.0, f64::max);
    assert!(error < 1e-6, "{error}");
}

#[test]
fn the_nearer_ear_hears_earlier_and_louder() {
    let sound = click(500);
    for (place, near) in [([2.0, 1.6, 0.0], 0), ([-2.0, 1.6, 0.5], 1)] {
        let ears = heard(&sound, place);
        let (first, later) = (loudest(&ears[near]), loudest(&ears[1 - near]));
        // Woodworth: (pi / 2 + 1) a / c = 0.66 ms, 16 samples, at the side.
        assert!((12..=18).contains(&(later - first)), "{first} {later}");
        assert!(ears[near][first].abs() > 2.0 * ears[1 - near][later].abs());
    }
    let [left, right] = heard(&sound, [0.0, 1.6, 2.0]);
    let difference = left.iter().zip(&right).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(difference < 1e-12, "{difference}");
    let ahead = loudest(&left);
    assert!((ahead as f64 - 500.0 - 2.0 / SPEED * 24_000.0).abs() < 3.0, "{ahead}");
}

#[test]
fn a_source_that_is_twice_as_far_is_half_as_loud() {
    let energy = |place| heard(&click(500), place).concat().iter().map(|v| v * v).sum::<f64>().sqrt();
    let ratio = energy([0.0, 1.6, 2.0]) / energy([0.0, 1.6, 4.0]);
    assert!((ratio - 2.0).abs() < 1e-3, "{ratio}");
    let near = energy([0.0, 1.6, 0.1]) / energy([0.0, 1.6, 0.3]);
    assert!((near - 1.0).abs() < 1e-9, "nearer than 0.3 m is no louder: {near}");
}

#[test]
fn places_and_sounds_that_cannot_be_are_typed_errors() {
    let place = |place| check_place(place).unwrap_err().kind();
    assert_eq!(place([f64::NAN, 1.0, 1.0]), ErrorKind::Argument);
    assert_eq!(place([0.0, f64::INFINITY, 1.0]), ErrorKind::Argument);
    assert_eq!(place([0.0, 1.0, -101.0]), ErrorKind::Argument);
    assert_eq!(place([0.03, 1.63, -0.03]), ErrorKind::Argument);
    assert!(check_place([0.1, 1.6, 0.0]).is_ok());
    let add = |sound: &[f32], start| {
        let at = [1.0, 1.0, 1.0];
        Ears::new(800).add(sound, start, at, &Room::around(at), &mut none).map_err(|e| e.kind())
    };
    assert_eq!(add(&[], 0), Err(ErrorKind::Audio));
    assert_eq!(add(&[0.5; 10], 800), Err(ErrorKind::Audio));
    assert_eq!(add(&[0.5, f32::NAN], 0), Err(ErrorKind::Audio));
    assert!(add(&[0.5; 10], 799).is_ok());
}

#[test]
fn too_loud_is_clipped_and_counted() {
    let mut ears = Ears::new(4800);
    let at = [0.0, 1.6, 0.5];
    ears.add(&[f32::MAX / 1e20; 2000], 100, at, &Room::around(at), &mut plain).unwrap();
    let (ears, clipped) = ears.finish(30.0, &mut plain);
    assert!(clipped > 1000 && ears.iter().flatten().all(|v| v.abs() <= 1.0));
}
