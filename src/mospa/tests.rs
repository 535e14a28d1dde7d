use super::*;
use crate::kernels::Scheme;
use safetensors::SafeTensors;

const BUNDLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/goldens/mospa.safetensors");

/// What PyTorch computed.
struct Golden(Vec<u8>);

impl Golden {
    fn read() -> Self {
        Self(std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/goldens/mospa.out.safetensors")).unwrap())
    }

    fn get(&self, name: &str) -> Vec<f32> {
        let file = SafeTensors::deserialize(&self.0).unwrap();
        let view = file.tensor(name).unwrap();
        match view.dtype() {
            safetensors::Dtype::F16 => {
                view.data().as_chunks::<2>().0.iter().map(|b| half::f16::from_le_bytes(*b).to_f32()).collect()
            }
            _ => view.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect(),
        }
    }

    /// The ears of the model's tests, as the golden's program makes them.
    fn ears(&self) -> [Vec<f64>; 2] {
        let file = SafeTensors::deserialize(&self.0).unwrap();
        let sound = file.tensor("sound").unwrap();
        let value = |b: &[u8; 2]| f64::from(i16::from_le_bytes(*b)) / 32768.0;
        let left: Vec<f64> = sound.data().as_chunks::<2>().0[..12_800].iter().map(value).collect();
        let right = (0..left.len()).map(|n| if n < 12 { 0.0 } else { 0.5 * left[n - 12] }).collect();
        [left, right]
    }
}

fn tiny(kernels: Kernels) -> Reactor {
    Reactor::load(&BundleFile::open(BUNDLE).unwrap(), kernels).unwrap()
}

fn error(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn place(golden: &Golden) -> Option<[f32; 3]> {
    golden.get("location").try_into().ok()
}

#[test]
fn equals_pytorch() {
    let golden = Golden::read();
    let reactor = tiny(Kernels::detect().unwrap());
    let [left, right] = golden.ears().map(|ear| crate::audio::features::ear(&ear).unwrap());
    assert!(error(&left, &golden.get("left")) < 1e-4 && error(&right, &golden.get("right")) < 1e-4);
    let heard = Heard { left: &left, right: &right, place: place(&golden), genre: Some(2) };
    let noise = golden.get("noise");

    let x0 = reactor.clean(&heard, &noise, 999).unwrap();
    assert!(error(&x0, &golden.get("x0")) < 2e-4, "{}", error(&x0, &golden.get("x0")));
    let motion = reactor.motion(&heard, &noise, 4, 1).unwrap();
    let wanted = golden.get("motion");
    assert!(error(&motion, &wanted) < 2e-4, "{}", error(&motion, &wanted));
    let unknown = Heard { place: None, genre: None, ..heard };
    let blind = reactor.motion(&unknown, &noise, 4, 2).unwrap();
    assert!(error(&blind, &golden.get("blind")) < 2e-4, "{}", error(&blind, &golden.get("blind")));
    assert!(error(&motion, &blind) > 1e-3, "place and sensitivity are told");

    let frames = reactor.poses(&wanted).unwrap();
    let positions: Vec<f32> = frames.iter().flat_map(|f| f.global.iter().flat_map(|t| t.position.to_array())).collect();
    assert!(error(&positions, &golden.get("positions")) < 1e-4, "{}", error(&positions, &golden.get("positions")));
    let rotations = golden.get("rotations");
    for (found, wanted) in frames.iter().flat_map(|f| &f.global).zip(rotations.as_chunks::<4>().0) {
        assert!(found.rotation.dot(glam::Quat::from_array(*wanted)).abs() > 1.0 - 1e-5);
    }
}

#[test]
fn bits_agree_on_every_level_and_with_two_threads() {
    let golden = Golden::read();
    let (left, right, noise) = (golden.get("left"), golden.get("right"), golden.get("noise"));
    let heard = Heard { left: &left, right: &right, place: place(&golden), genre: Some(0) };
    let levels = Kernels::available().into_iter().map(|level| Kernels::with_level(level).unwrap());
    let motions: Vec<_> = levels
        .flat_map(|kernels| [1, 2].map(|threads| tiny(kernels).motion(&heard, &noise, 3, threads).unwrap()))
        .collect();
    let bits = |x: &[f32]| x.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert!(motions.iter().all(|motion| bits(motion) == bits(&motions[0])));
}

#[test]
fn seeds_make_the_noise_and_every_number_of_steps_ends() {
    let reactor = tiny(Kernels::detect().unwrap());
    assert_eq!(reactor.noise(3), reactor.noise(3));
    assert_ne!(reactor.noise(3), reactor.noise(4));
    let silence = vec![0.0; reactor.frames() * SIZE];
    let heard = Heard { left: &silence, right: &silence, place: None, genre: None };
    for steps in [1, 4, 100, 1000] {
        let motion = reactor.motion(&heard, &reactor.noise(1), steps, 1).unwrap();
        assert_eq!(reactor.poses(&motion).unwrap().len(), reactor.frames());
    }
}

/// Seeded weights of each scheme; a tiny bundle's are too small to be integers.
#[test]
fn weights_of_every_scheme_run_and_take_less_memory() {
    let mut config = BundleFile::open(BUNDLE).unwrap().parse().unwrap().0;
    let mospa = config.mospa.as_mut().unwrap();
    (mospa.width, mospa.heads, mospa.frames) = (192, 8, 32);
    let features: Vec<f32> = (0..32 * SIZE).map(|i| (i % 17) as f32 / 17.0).collect();
    let heard = Heard { left: &features, right: &features, place: Some([1.0, 1.0, 1.0]), genre: Some(1) };
    let bytes = |scheme| {
        let kernels = Kernels::detect().unwrap();
        let reactor = Reactor::from_tensors(config.clone(), &Tensors::seeded(scheme), kernels).unwrap();
        let [one, two] = [1, 2].map(|threads| reactor.motion(&heard, &reactor.noise(5), 4, threads).unwrap());
        assert!(one == two && one.iter().all(|v| v.is_finite()) && one.iter().any(|v| *v != one[0]));
        reactor.bytes()
    };
    let [big, middle, small] = [Scheme::F32, Scheme::F16, Scheme::I8].map(bytes);
    assert!(small < middle && middle < big, "{small} {middle} {big}");
}

#[test]
fn bad_input_is_a_typed_error() {
    let reactor = tiny(Kernels::detect().unwrap());
    let features = vec![0.5; reactor.frames() * SIZE];
    let broken = vec![f32::NAN; reactor.frames() * SIZE];
    let noise = reactor.noise(0);
    let heard = Heard { left: &features, right: &features, place: Some([1.0, 1.0, 1.0]), genre: Some(1) };
    let kind = |heard: Heard<'_>, noise: &[f32], steps, threads| {
        reactor.motion(&heard, noise, steps, threads).map(drop).map_err(|e| e.kind())
    };
    let argument = Err(ErrorKind::Argument);
    assert_eq!(kind(heard, &noise, 4, 1), Ok(()));
    assert_eq!(kind(heard, &noise, 0, 1), argument);
    assert_eq!(kind(heard, &noise, 1001, 1), argument);
    assert_eq!(kind(heard, &noise, 4, 3), argument);
    assert_eq!(kind(heard, &noise[1..], 4, 1), argument);
    assert_eq!(kind(Heard { left: &features[1..], ..heard }, &noise, 4, 1), argument);
    assert_eq!(kind(Heard { right: &broken, ..heard }, &noise, 4, 1), argument);
    assert_eq!(kind(Heard { place: Some([f32::NAN, 0.0, 0.0]), ..heard }, &noise, 4, 1), argument);
    assert_eq!(kind(Heard { genre: Some(3), ..heard }, &noise, 4, 1), argument);
}

#[test]
fn bundles_of_wrong_sizes_and_kinds_are_refused() {
    let file = BundleFile::open(BUNDLE).unwrap();
    let kernels = Kernels::detect().unwrap();
    let load = |change: fn(&mut MospaConfig)| {
        let (mut config, tensors) = file.parse().unwrap();
        change(config.mospa.as_mut().unwrap());
        Reactor::from_tensors(config, &tensors, kernels).map(drop).map_err(|e| e.kind())
    };
    assert_eq!(load(|_| ()), Ok(()));
    let invalid = Err(ErrorKind::BundleInvalid);
    assert_eq!(load(|c| c.width = 32), invalid);
    assert_eq!(load(|c| c.layers = 1), invalid, "tensors that nobody reads");
    assert_eq!(load(|c| c.layers = 3), invalid);
    assert_eq!(load(|c| c.mlp = 4), invalid);
    assert_eq!(load(|c| c.patch = 4), invalid);
    let other = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/goldens/tiny.safetensors");
    let e = Reactor::load(&BundleFile::open(other).unwrap(), kernels).unwrap_err();
    assert_eq!(e.kind(), ErrorKind::Argument);
}
