use super::*;
use glam::DVec3;
use visavis::BundleFile;
use visavis::internals::kernels::Kernels;

fn reactor() -> Reactor {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/mospa.safetensors");
    Reactor::load(&BundleFile::open(path).unwrap(), Kernels::detect().unwrap()).unwrap()
}

fn sound(place: [f64; 3], start: f64, level: f32) -> Sound {
    let samples = (0..4800).map(|i| level * (i as f32 * 0.1).sin()).collect();
    Sound { name: "tone".into(), samples, place: DVec3::from_array(place), start, id: None }
}

const OPTIONS: Options = Options { sensitivity: Some(1), steps: Some(4), seed: 3, threads: 1 };

#[test]
fn a_clip_has_all_frames_and_repeats_to_the_bit() {
    let reactor = reactor();
    let sounds = [sound([2.0, 1.0, 1.0], 0.1, 0.5), sound([-1.0, 1.0, 1.0], 0.0, 0.1)];
    let outcome = run(&reactor, &sounds, &OPTIONS).unwrap();
    let frames = &outcome.recording.frames;
    assert_eq!((frames.len(), outcome.told, outcome.steps, outcome.clipped), (16, 0, 4, 0));
    let again = run(&reactor, &sounds, &Options { threads: 2, ..OPTIONS }).unwrap();
    assert_eq!(*frames, again.recording.frames);
    let other = run(&reactor, &sounds, &Options { seed: 4, ..OPTIONS }).unwrap();
    assert_ne!(*frames, other.recording.frames);
    let heard = outcome.recording.sounds.unwrap();
    assert_eq!(heard.heard.len(), 16 * FRAME_SAMPLES);
    assert_eq!(heard.sources[0].seconds[0], 0.1);
}

#[test]
fn what_cannot_be_is_a_typed_error_and_what_is_too_loud_is_bounded() {
    let reactor = reactor();
    let kind = |sounds: &[Sound], options: &Options| run(&reactor, sounds, options).map(drop).map_err(|e| e.kind());
    let (argument, audio) = (Err(ErrorKind::Argument), Err(ErrorKind::Audio));
    let good = sound([2.0, 1.0, 1.0], 0.0, 0.5);
    assert_eq!(kind(&[], &OPTIONS), argument);
    assert_eq!(kind(&vec![good.clone(); 100], &OPTIONS), argument);
    assert_eq!(kind(&[sound([f64::NAN, 1.0, 1.0], 0.0, 0.5)], &OPTIONS), argument);
    assert_eq!(kind(&[sound([0.0, 1.6, 0.0], 0.0, 0.5)], &OPTIONS), argument);
    assert_eq!(kind(&[sound([0.0, 1.6, 0.05], 0.0, 0.5)], &OPTIONS), argument);
    assert_eq!(kind(&[sound([200.0, 1.0, 1.0], 0.0, 0.5)], &OPTIONS), argument);
    assert_eq!(kind(&[sound([2.0, 1.0, 1.0], 60.0, 0.5)], &OPTIONS), audio);
    assert_eq!(kind(&[Sound { samples: Vec::new(), ..good.clone() }], &OPTIONS), audio);
    assert_eq!(kind(&[Sound { samples: vec![f32::NAN], ..good.clone() }], &OPTIONS), audio);
    assert_eq!(kind(std::slice::from_ref(&good), &Options { steps: Some(0), ..OPTIONS }), argument);
    assert_eq!(kind(std::slice::from_ref(&good), &Options { steps: Some(1001), ..OPTIONS }), argument);
    assert_eq!(kind(&vec![good; MAX_SOUNDS], &OPTIONS), Ok(()));
    let loud = run(&reactor, &[sound([0.5, 1.6, 0.0], 0.0, 1e6)], &OPTIONS).unwrap();
    assert!(loud.clipped > 1000);
    assert!(loud.recording.sounds.unwrap().heard.iter().all(|v| v.abs() <= 1.0));
}
