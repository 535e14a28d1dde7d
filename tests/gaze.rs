//! What a calibration of gaze changes: targets go through its curves, free gaze gets its levels,
//! and nothing else.

mod common;

use common::{Inputs, golden_path, run, tiny};
use std::sync::Arc;
use visavis::internals::config::{Config, GazeConfig, ResponseCurve};
use visavis::internals::session::{Diagnostics, GazeControl};
use visavis::{BundleFile, Engine, ErrorKind, Frame, Sampler, SessionOptions};

const BLOCKS: usize = 12;

fn gaze() -> GazeConfig {
    GazeConfig {
        guided: ResponseCurve(vec![[0.0, -0.5], [1.0, 0.5]]),
        unguided: ResponseCurve(vec![[0.0, -0.8], [1.0, 0.8]]),
        student: Some(ResponseCurve(vec![[0.0, 0.25], [1.0, 0.75]])),
        levels: vec![0.25],
        seconds: 10.0,
    }
}

fn control(gaze_control: GazeControl) -> Diagnostics {
    Diagnostics { gaze_control, ..Default::default() }
}

fn with(gaze: &GazeConfig) -> visavis::Result<Arc<Engine>> {
    let config = Config { gaze: Some(gaze.clone()), ..tiny().config().clone() };
    let bytes = BundleFile::open(golden_path("tiny.safetensors"))?.with_settings(&config)?;
    Engine::from_bytes(bytes, "calibrated")
}

fn motion(engine: &Arc<Engine>, options: SessionOptions) -> Vec<Frame> {
    let inputs = Inputs::circling(common::block_seconds(BLOCKS), 24_000);
    run(&mut engine.session(options).unwrap(), &inputs, BLOCKS)
}

#[test]
fn targets_and_free_gaze_are_what_the_calibration_says() {
    let (plain, calibrated) = (tiny(), with(&gaze()).unwrap());
    // What was wanted, and the value of the channel that stands for it.
    let cases = [
        (Sampler::Midpoint2, Some(0.75), 0.25, GazeControl::Channel),
        (Sampler::Midpoint2, None, -0.4, GazeControl::Unguided),
        (Sampler::Single, Some(0.5), 0.5, GazeControl::Channel),
        (Sampler::Single, None, 0.375, GazeControl::Channel),
    ];
    for (sampler, wanted, value, gaze_control) in cases {
        let a = motion(&calibrated, SessionOptions { sampler, gaze: wanted, ..Default::default() });
        let b = motion(
            &plain,
            SessionOptions { sampler, gaze: Some(value), diagnostics: control(gaze_control), ..Default::default() },
        );
        assert_eq!(a, b, "{sampler}, target {wanted:?}");
    }
}

#[test]
fn unguided_is_neither_guided_nor_absent() {
    let engine = tiny();
    let options =
        |gaze, gaze_control| SessionOptions { gaze, diagnostics: control(gaze_control), ..Default::default() };
    let unguided = motion(&engine, options(Some(0.3), GazeControl::Unguided));
    assert_ne!(unguided, motion(&engine, options(Some(0.3), GazeControl::Channel)));
    assert_ne!(unguided, motion(&engine, options(None, GazeControl::Channel)));
    // Without a guidance weight of its own, a guided target has no effect; an unguided one still
    // has.
    let unweighted = |gaze, gaze_control| {
        let options = options(gaze, gaze_control);
        motion(&engine, SessionOptions { gaze_guidance: Some(0.0), ..options })
    };
    assert_eq!(unweighted(Some(0.3), GazeControl::Channel), unweighted(None, GazeControl::Channel));
    assert_eq!(unweighted(Some(0.3), GazeControl::Unguided), unguided);
}

#[test]
fn a_calibration_that_makes_no_sense_is_refused() {
    let bad = [
        GazeConfig { guided: ResponseCurve(vec![]), ..gaze() },
        GazeConfig { guided: ResponseCurve(vec![[0.5, 0.0], [0.5, 1.0]]), ..gaze() },
        GazeConfig { student: Some(ResponseCurve(vec![[0.1, 0.3], [0.5, 0.1]])), ..gaze() },
        GazeConfig { unguided: ResponseCurve(vec![[0.1, 7.0]]), ..gaze() },
        GazeConfig { levels: vec![], ..gaze() },
        GazeConfig { levels: vec![f32::NAN], ..gaze() },
        GazeConfig { seconds: 0.0, ..gaze() },
    ];
    for config in bad {
        assert_eq!(with(&config).map(|_| ()).unwrap_err().kind(), ErrorKind::BundleInvalid, "{config:?}");
    }
}
