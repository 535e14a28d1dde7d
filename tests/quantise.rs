//! Quantised bundles: made alike every time, loaded with checks, and close to what they were made
//! from.

mod common;

use common::{Inputs, golden_path, hearing, hearing_bytes, hearing_f32, motion_of, noise, tiny, tiny_f32, tiny_in};
use safetensors::SafeTensors;
use std::sync::Arc;
use visavis::internals::bundle::{TensorInfo, int16_activations};
use visavis::internals::config::{Config, GazeConfig, ResponseCurve};
use visavis::internals::kernels::{Kernels, Scheme};
use visavis::internals::quant::{Budget, Keep, Options, Scene, Sound, Teacher, quantise};
use visavis::internals::session::{Anchoring, Diagnostics, GazeControl};
use visavis::{BundleFile, Engine, ErrorKind, Frame, Sampler, SessionOptions};

fn options(scheme: Scheme, keep: &[Keep]) -> Options<'_> {
    Options { scheme, smallest: 0, keep, calibration: None, budget: None }
}

/// What a bundle holds, as its tensors say themselves.
fn infos(file: &BundleFile<'_>) -> Vec<TensorInfo> {
    file.parse().unwrap().1.infos()
}

/// The tiny bundle with a calibration of gaze, whose free levels change every second or so.
fn with_gaze() -> Arc<Engine> {
    let gaze = GazeConfig {
        guided: ResponseCurve(vec![[0.0, -0.5], [1.0, 0.5]]),
        unguided: ResponseCurve(vec![[-1.0, -0.8], [1.0, 0.8]]),
        student: Some(ResponseCurve(vec![[-1.0, -0.25], [1.0, 0.75]])),
        levels: vec![-0.3, 0.2, 0.9],
        seconds: 1.0,
    };
    let file = BundleFile::open(golden_path("tiny.safetensors")).unwrap();
    let bytes = file.with_settings(&Config { gaze: Some(gaze), ..tiny().config().clone() }).unwrap();
    Engine::from_bytes(bytes, "calibrated").unwrap()
}

fn scene(blocks: usize) -> Scene {
    let inputs = Inputs::circling(4.0, 24_000);
    Scene::new(Some(&inputs.agent), Some(&inputs.user), inputs.path, blocks, Some(0.5)).unwrap()
}

/// That with two sounds, the first of which begins with block 2.
fn sounding(blocks: usize) -> Scene {
    let sound = |id, block, samples, place: [f32; 3]| Sound { id, block, samples, place: place.into() };
    scene(blocks).with_sounds(vec![
        sound(1, 2, noise(5, 9_000, 1.5), [-1.0, 0.3, -2.0]),
        sound(2, 7, noise(6, 5_000, 0.2), [2.0, 0.8, 0.5]),
    ])
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    for scheme in [Scheme::F16, Scheme::I8, Scheme::I4] {
        let once = quantise(&tiny_f32(), &options(scheme, &[])).unwrap().bytes;
        assert_eq!(once, quantise(&tiny_f32(), &options(scheme, &[])).unwrap().bytes, "{scheme}");
    }
}

#[test]
fn blocks_stay_close_in_the_order_of_the_schemes() {
    let reference = Engine::from_file(&tiny_f32(), Kernels::detect().unwrap()).unwrap();
    for sampler in [Sampler::Midpoint4, Sampler::Single] {
        let teacher = Teacher::new(&reference, scene(12), sampler, 1, &mut None).unwrap();
        let same = teacher.compare(&reference).unwrap();
        assert_eq!((same.mean_mm(), same.round_trip_mm()), (0.0, 0.0), "nothing differs from itself");
        let mm = |scheme| {
            let forced = teacher.compare(&tiny_in(scheme)).unwrap();
            assert_eq!(forced.frames.len(), 48);
            (forced.mean_mm(), forced.round_trip_mm())
        };
        let (f16, i8, i4) = (mm(Scheme::F16), mm(Scheme::I8), mm(Scheme::I4));
        println!("{sampler}: mm of a block, and through the VAE: f16 {f16:?}, i8 {i8:?}, i4 {i4:?}");
        assert!(0.0 < f16.0 && f16.0 < i8.0 && i8.0 < i4.0, "{f16:?} {i8:?} {i4:?}");
        assert!(f16.1 < i8.1 && i8.1 < i4.1, "{f16:?} {i8:?} {i4:?}");
    }
}

/// What is measured is what a session does: the reference's free run has the bits of a plain
/// session that is driven as any caller drives it, with free gaze, whose levels are drawn from the
/// calibration, and with a target.
#[test]
fn the_teacher_runs_as_a_plain_session_does() {
    let engine = with_gaze();
    let inputs = Inputs::circling(6.0, 24_000);
    let blocks = 30;
    for (gaze, seed, sampler) in [
        (None, 3, Sampler::Midpoint4),
        (None, 4, Sampler::Midpoint4),
        (Some(0.3), 3, Sampler::Midpoint2),
        (None, 3, Sampler::Single),
    ] {
        let scene = Scene::new(Some(&inputs.agent), Some(&inputs.user), inputs.path.clone(), blocks, gaze).unwrap();
        let teacher = Teacher::new(&engine, scene.clone(), sampler, seed, &mut None).unwrap();
        let options =
            SessionOptions { seed, sampler, gaze, diagnostics: Anchoring::Never.into(), ..Default::default() };
        let plain = motion_of(&engine, options.clone(), &inputs, blocks);
        // The gaze of a frame is measured against the head as known by then; it does not steer.
        let shown =
            |frames: &[Frame]| -> Vec<Frame> { frames.iter().map(|f| Frame { gaze: None, ..f.clone() }).collect() };
        let taught: Vec<_> = teacher.frames().cloned().collect();
        assert_eq!(shown(&taught), shown(&plain), "{sampler}, seed {seed}, gaze {gaze:?}");
        let channel = Diagnostics { gaze_control: GazeControl::Channel, ..options.diagnostics };
        let channel = SessionOptions { diagnostics: channel, ..options };
        assert_ne!(shown(&motion_of(&engine, channel, &inputs, blocks)), shown(&plain), "the calibration is in it");
        // A candidate that is forced onto what it would make anyway makes it.
        assert_eq!(teacher.compare(&engine).unwrap().mean_mm(), 0.0);
    }
}

/// What is damaged of all that hears, shows; without sounds it would not.
#[test]
fn sounds_of_a_scene_reach_all_that_hears() {
    let damaged = |name: &str| {
        let mut bytes = hearing_bytes();
        let at = {
            let file = SafeTensors::deserialize(&bytes).unwrap();
            let data = file.tensor(name).unwrap().data().as_ptr_range();
            let start = bytes.as_ptr() as usize;
            data.start as usize - start..data.end as usize - start
        };
        // Weights change their signs.
        bytes[at].chunks_exact_mut(4).for_each(|v| v[3] ^= 0x80);
        Engine::from_bytes(bytes, "damaged").unwrap()
    };
    for (sampler, net) in [(Sampler::Midpoint4, "flow"), (Sampler::Single, "student")] {
        let teach = |scene| Teacher::new(&hearing(), scene, sampler, 1, &mut None).unwrap();
        let (quiet, loud) = (teach(scene(10)), teach(sounding(10)));
        assert_eq!(loud.compare(&hearing()).unwrap().mean_mm(), 0.0);
        let frames = |teacher: &Teacher| teacher.frames().cloned().collect::<Vec<_>>();
        // The block after that in which the first sounded answers it.
        let (without, with) = (frames(&quiet), frames(&loud));
        assert!(without[..12] == with[..12] && without[12..16] != with[12..16]);
        for name in ["hearing.conv.2", "appraisal.lstm", &format!("{net}.embed_sound.0"), &format!("{net}.input_sound")]
        {
            let candidate = damaged(&format!("{name}.weight"));
            let [quiet, loud] = [&quiet, &loud].map(|teacher| teacher.compare(&candidate).unwrap().mean_mm());
            println!("{sampler}, {name}: {loud} mm");
            assert!(quiet == 0.0 && loud > 1e-3, "{sampler}, {name}: {quiet} mm, and with sounds {loud}");
        }
    }
}

/// Rounding for the inputs that layers get knows those of what hears.
#[test]
fn calibration_hears_the_sounds_of_a_scene() {
    let rounded = |scene: Option<Scene>| {
        let options = Options { calibration: scene.as_ref(), ..options(Scheme::I8, &[]) };
        quantise(&hearing_f32(), &options).unwrap().bytes
    };
    let weights = |bytes: &[u8], name: &str| {
        SafeTensors::deserialize(bytes).unwrap().tensor(&format!("{name}.weight")).unwrap().data().to_vec()
    };
    let (plain, quiet, loud) = (rounded(None), rounded(Some(scene(10))), rounded(Some(sounding(10))));
    for name in ["flow.embed_sound.0", "student.embed_sound.0"] {
        let [plain, quiet, loud] = [&plain, &quiet, &loud].map(|bytes| weights(bytes, name));
        assert!(plain == quiet && plain != loud, "{name}");
    }
}

/// Who does not hear is told of no sounds.
#[test]
fn sounds_of_a_scene_are_for_those_that_hear() {
    let teach = |scene| Teacher::new(&tiny(), scene, Sampler::Single, 1, &mut None).unwrap();
    assert!(teach(scene(6)).frames().eq(teach(sounding(6)).frames()));
}

/// One that is conditioned otherwise cannot be compared.
#[test]
fn another_calibration_is_refused() {
    let teacher = Teacher::new(&with_gaze(), scene(2), Sampler::Single, 0, &mut None).unwrap();
    let e = teacher.compare(&tiny()).unwrap_err();
    assert!(e.kind() == ErrorKind::Argument && e.to_string().contains("calibration"), "{e}");
}

/// Rounding for the inputs that layers get: better blocks of the same size, and the same bytes
/// every time.
#[test]
fn calibrated_rounding_loses_less() {
    let reference = Engine::from_file(&tiny_f32(), Kernels::detect().unwrap()).unwrap();
    let calibration = scene(20);
    for scheme in [Scheme::I8, Scheme::I4] {
        let with =
            || quantise(&tiny_f32(), &Options { calibration: Some(&calibration), ..options(scheme, &[]) }).unwrap();
        let (plain, calibrated) = (quantise(&tiny_f32(), &options(scheme, &[])).unwrap(), with());
        assert_eq!(calibrated.bytes.len(), plain.bytes.len());
        assert!(calibrated.bytes == with().bytes);
        // Other noise than the calibration's.
        let teacher = Teacher::new(&reference, scene(20), Sampler::Midpoint4, 5, &mut None).unwrap();
        let latents = |bytes: Vec<u8>| {
            let forced = teacher.compare(&Engine::from_bytes(bytes, "tiny").unwrap()).unwrap();
            visavis::internals::quant::sqnr_db(&forced.latents[0], &forced.latents[1])
        };
        let (plain, calibrated) = (latents(plain.bytes), latents(calibrated.bytes));
        println!("{scheme}: latents {plain:.2} dB, calibrated {calibrated:.2} dB");
        if scheme == Scheme::I4 {
            assert!(calibrated > plain + 1.0, "{calibrated} dB after {plain} dB");
        }
    }
}

#[test]
fn sessions_have_the_same_bits_on_every_level_and_with_two_threads() {
    for scheme in [Scheme::F16, Scheme::I8, Scheme::I4] {
        let bytes = quantise(&tiny_f32(), &options(scheme, &[])).unwrap().bytes;
        let inputs = Inputs::circling(2.0, 24_000);
        let run = |level, threads| {
            let file = BundleFile::from_bytes(bytes.clone(), "tiny");
            let engine = Engine::from_file(&file, Kernels::with_level(level).unwrap()).unwrap();
            motion_of(&engine, SessionOptions { threads, ..Default::default() }, &inputs, 8)
        };
        let levels = Kernels::available();
        let first = run(levels[0], 1);
        for level in levels {
            assert!(run(level, 2) == first, "{scheme} at {level}");
        }
    }
}

/// The networks' transformer layers, where the time goes, take int8; every name that the rule
/// speaks of is that of a layer.
#[test]
fn int16_activations_are_those_of_named_layers() {
    let tensors = infos(&tiny_f32());
    let names: Vec<_> = tensors.iter().filter_map(|t| t.name.strip_suffix(".weight")).collect();
    let (wide, narrow): (Vec<&str>, Vec<&str>) = names.iter().partition(|name| int16_activations(name));
    for name in ["flow.final.out", "student.final.mod", "flow.tau.0", "flow.layers.0.mod", "vae.decoder.latent"] {
        assert!(wide.contains(&name), "{name} of {wide:?}");
    }
    for name in ["vae.decoder.layers.0.fc2", "vae.decoder.out", "vae.encoder.frame", "vae.encoder.mu"] {
        assert!(wide.contains(&name), "{name} of {wide:?}");
    }
    for part in ["qkv", "proj", "fc1", "fc2"] {
        for network in ["flow", "student", "vae.encoder"] {
            let name = format!("{network}.layers.0.{part}");
            assert!(narrow.contains(&name.as_str()), "{name} of {narrow:?}");
        }
    }
}

/// The last layers of flow and decoder, whose errors nothing evens out, are int8 in int4 bundles.
#[test]
fn last_layers_are_no_int4() {
    let schemes = quantise(&tiny_f32(), &options(Scheme::I4, &[])).unwrap().schemes;
    for (name, scheme) in [
        ("flow.final.out", Scheme::I8),
        ("student.final.out", Scheme::I8),
        ("vae.decoder.out", Scheme::I8),
        ("vae.decoder.layers.0.fc2", Scheme::I4),
        ("flow.layers.0.fc2", Scheme::I4),
    ] {
        assert_eq!(schemes[name], scheme, "{name}");
    }
}

#[test]
fn quantising_twice_is_refused() {
    for (first, second) in
        [(Scheme::I8, Scheme::I8), (Scheme::I8, Scheme::F16), (Scheme::I4, Scheme::I8), (Scheme::F16, Scheme::F16)]
    {
        let bytes = quantise(&tiny_f32(), &options(first, &[])).unwrap().bytes;
        let e = quantise(&BundleFile::from_bytes(bytes, "once"), &options(second, &[])).unwrap_err();
        assert!(e.kind() == ErrorKind::Argument && e.to_string().starts_with("once: it is quantised"), "{e}");
    }
    let e =
        quantise(&BundleFile::open(golden_path("tiny.safetensors")).unwrap(), &options(Scheme::F16, &[])).unwrap_err();
    assert!(e.to_string().contains("already, to f16"), "{e}");
    let halves = quantise(&tiny_f32(), &options(Scheme::F16, &[])).unwrap().bytes;
    quantise(&BundleFile::from_bytes(halves, "halves"), &options(Scheme::I8, &[])).expect("f16 is a fine start");
}

/// Damage that only quantised bundles can have.
#[test]
fn damaged_schemes_are_typed_errors() {
    let damaged = |scheme, from: &str, to: &str| {
        let mut bytes = quantise(&tiny_f32(), &options(scheme, &[])).unwrap().bytes;
        assert_eq!(from.len(), to.len(), "the header keeps its length");
        let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        let at = bytes[..header].windows(from.len()).position(|w| w == from.as_bytes()).expect("it is in the header");
        bytes[at..at + from.len()].copy_from_slice(to.as_bytes());
        Engine::from_bytes(bytes, "damaged").map(|_| ()).unwrap_err()
    };
    let invalid = ErrorKind::BundleInvalid;
    let q = |name: &str, scheme: &str| format!("\\\"{name}\\\":\\\"{scheme}\\\"");
    for (from, to) in [
        (q("vae.decoder.out.weight", "i8"), q("vae.decoder.out.weight", "i4")),
        (q("vae.decoder.out.weight", "i8"), q("vae.decoder.0ut.weight", "i8")),
        ("\"vae.decoder.out.scale\"".to_owned(), "\"vae.decoder.out.skale\"".to_owned()),
        (q("vae.decoder.out.weight", "i8"), q("vae.decoder.out.weight", "i9")),
    ] {
        let e = damaged(Scheme::I8, &from, &to);
        assert!(e.kind() == invalid && e.to_string().starts_with("damaged: "), "{to}: {e}");
    }
    let e = damaged(Scheme::I4, &q("flow.layers.0.qkv.weight", "i4"), &q("flow.layers.0.qkv.weight", "i8"));
    assert!(e.kind() == invalid && e.to_string().contains("shape"), "{e}");
}

/// A flipped bit of a value makes another value; of a scale perhaps one that is refused, and
/// nothing worse.
#[test]
fn flipped_bits_are_errors_or_harmless() {
    for scheme in [Scheme::I8, Scheme::I4] {
        let bytes = quantise(&tiny_f32(), &options(scheme, &[])).unwrap().bytes;
        let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        for at in (header + 3..bytes.len()).step_by(bytes.len() / 150) {
            let mut bytes = bytes.clone();
            bytes[at] ^= 0x80;
            match Engine::from_bytes(bytes, "flipped") {
                Err(e) => assert!(e.kind() == ErrorKind::BundleCorrupt || e.kind() == ErrorKind::BundleInvalid, "{e}"),
                Ok(engine) => {
                    let mut session = engine.session(SessionOptions::default()).unwrap();
                    let frames = session.poll(0.0);
                    assert!(frames.is_err() || frames.is_ok_and(|f| f.unwrap()[3].global[0].position.is_finite()));
                }
            }
        }
    }
}

/// Half the bytes of f32, by every tensor but the statistics, and the idle clip as the latents that
/// the encoder makes of it.
#[test]
fn a_bundle_of_halves_is_half_a_bundle() {
    let file = tiny_f32();
    let keep = ["flow.layers.0.fc1=f32".parse().unwrap()];
    let before = infos(&file);
    let bytes = |tensors: &[TensorInfo]| tensors.iter().map(|t| t.bytes).sum::<usize>();
    let halves = quantise(&file, &Options { smallest: 8192, ..options(Scheme::F16, &[]) }).unwrap().bytes;
    let halves = infos(&BundleFile::from_bytes(halves, "halves"));
    assert!(2 * bytes(&halves) <= bytes(&before), "{} of {}", bytes(&halves), bytes(&before));
    for t in &halves {
        let vector = t.shape.len() < 2 || !t.name.ends_with(".weight");
        let float =
            t.name.starts_with("stats.") || t.name == "idle.latents" || t.name.starts_with("vae.decoder.") && vector;
        assert_eq!(t.dtype, if float { "f32" } else { "f16" }, "{}", t.name);
    }

    let quantised = quantise(&file, &options(Scheme::F16, &keep)).unwrap().bytes;
    let kept = infos(&BundleFile::from_bytes(quantised.clone(), "kept"));
    let dtype = |name: &str| kept.iter().find(|t| t.name == name).map(|t| t.dtype.as_str());
    assert_eq!([dtype("flow.layers.0.fc1.bias"), dtype("flow.layers.1.fc1.bias")], [Some("f32"), Some("f16")]);
    assert_eq!([dtype("idle.frames"), dtype("idle.latents")], [None, Some("f32")]);
    let engine = |file: &BundleFile<'_>| Engine::from_file(file, Kernels::detect().unwrap()).unwrap();
    let (old, new) = (engine(&file), engine(&BundleFile::from_bytes(quantised, "kept")));
    assert!(old.idle_blocks() > 0 && old.idle_blocks() == new.idle_blocks());
}

#[test]
fn kept_layers_stay_floats() {
    let keep: Vec<Keep> = ["flow.layers.*", "*.qkv=f32"].iter().map(|k| k.parse().unwrap()).collect();
    let quantised = quantise(&tiny_f32(), &options(Scheme::I8, &keep)).unwrap();
    let scheme = |name: &str| quantised.schemes[name];
    assert_eq!(scheme("flow.layers.0.fc1"), Scheme::F16);
    assert_eq!(scheme("flow.layers.0.qkv"), Scheme::F32, "the last pattern decides");
    assert_eq!(scheme("student.layers.0.fc1"), Scheme::I8);
    let file = BundleFile::from_bytes(quantised.bytes.clone(), "kept");
    Engine::from_file(&file, Kernels::detect().unwrap()).unwrap();
    let tensors = infos(&file);
    let dtype = |name: &str| tensors.iter().find(|t| t.name == name).unwrap().dtype.clone();
    assert_eq!([dtype("flow.layers.0.fc1.weight"), dtype("student.layers.0.fc1.weight")], ["f16", "i8"]);
    let e = quantise(&tiny_f32(), &options(Scheme::I8, &["nobody.*".parse().unwrap()])).unwrap_err();
    assert!(e.kind() == ErrorKind::Argument && e.to_string().contains("nobody.*"), "{e}");
}

#[test]
fn a_budget_raises_layers_until_blocks_are_within_it() {
    let budget = |mm| Budget { mm, scene: scene(3), progress: &|_| {} };
    let run = |mm| {
        let budget = budget(mm);
        quantise(&tiny_f32(), &Options { budget: Some(&budget), ..options(Scheme::I4, &[]) }).unwrap()
    };
    let free = run(1000.0);
    let before = free.choice.as_ref().unwrap().before_mm;
    assert!(free.choice.unwrap().raised.is_empty() && before > 0.0);
    let half = run(before / 2.0);
    let choice = half.choice.unwrap();
    assert!(choice.after_mm <= before / 2.0 && !choice.raised.is_empty(), "{choice:?}");
    assert!(half.bytes.len() > free.bytes.len());
    // A budget that cannot be met ends with everything at f16.
    let none = run(1e-9);
    assert!(none.choice.unwrap().after_mm > 1e-9);
    assert!(
        none.schemes.iter().all(|(name, s)| *s == Scheme::F16 || name == "vae.encoder.logvar"),
        "{:?}",
        none.schemes
    );
}
