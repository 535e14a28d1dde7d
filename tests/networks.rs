//! Engines that hold some networks of a bundle only: the same motion in less memory, and typed
//! refusals.

mod common;

use common::{golden_path, tiny};
use std::sync::Arc;
use visavis::internals::config::CleanHistory;
use visavis::internals::kernels::{Kernels, Scheme};
use visavis::internals::quant::{Options, quantise};
use visavis::internals::session::{Anchoring, Diagnostics, HistoryTime};
use visavis::{BundleFile, Engine, ErrorKind, Networks, Sampler, SessionOptions};

fn load(networks: Networks) -> visavis::Result<Arc<Engine>> {
    let file = BundleFile::open(golden_path("tiny.safetensors")).expect("the tiny bundle opens");
    Engine::from_file_with(&file, Kernels::detect().expect("kernels"), networks)
}

#[test]
fn what_is_left_makes_the_same_motion_in_less_memory() {
    let whole = tiny();
    let all = Networks::default();
    for (networks, sampler) in [
        (Networks { reference: false, ..all }, Sampler::Single),
        (Networks { student: false, ..all }, Sampler::Midpoint4),
        (Networks { reference: false, encoder: false, ..all }, Sampler::Single),
        (Networks { student: false, encoder: false, ..all }, Sampler::euler(3).unwrap()),
    ] {
        let part = load(networks).expect("it loads");
        assert!(part.weight_bytes() < whole.weight_bytes());
        assert_eq!(part.block_bytes(sampler), whole.block_bytes(sampler));
        // A round of re-anchoring takes fewer blocks where there are fewer caches to renew.
        let options = SessionOptions { sampler, diagnostics: Anchoring::Never.into(), ..Default::default() };
        let [mut a, mut b] = [&part, &whole].map(|engine| engine.session(options.clone()).expect("session"));
        let (a_motion, b_motion) = (common::poll_blocks(&mut a, 40), common::poll_blocks(&mut b, 40));
        assert!(a_motion == b_motion, "{networks:?}");
        assert!(a.stats().cache_bytes < b.stats().cache_bytes);
    }
}

/// A quantised copy of the tiny bundle: it holds latents of the idle clip, so a lean engine reads
/// no encoder.
fn quantised() -> Vec<u8> {
    let file = BundleFile::open(golden_path("tiny.safetensors")).expect("the tiny bundle opens");
    let options = Options { scheme: Scheme::I8, smallest: 0, keep: &[], calibration: None, budget: None };
    quantise(&file, &options).expect("quantised").bytes
}

#[test]
fn tables_of_flow_times_make_the_same_motion_without_their_weights() {
    let bytes = quantised();
    let load = |modulation, encoder| {
        let networks = Networks { modulation, encoder, ..Networks::default() };
        let file = BundleFile::from_slice(&bytes, "quantised");
        Engine::from_file_with(&file, Kernels::detect().expect("kernels"), networks).expect("it loads")
    };
    let (whole, lean) = (load(true, true), load(false, false));
    assert!(lean.weight_bytes() < whole.weight_bytes());
    for sampler in [Sampler::Midpoint4, Sampler::Midpoint1, Sampler::euler(4).unwrap(), Sampler::Single] {
        let options = SessionOptions { sampler, diagnostics: Anchoring::Never.into(), ..Default::default() };
        let [mut a, mut b] = [&lean, &whole].map(|engine| engine.session(options.clone()).expect("session"));
        let blocks = |session: &mut _| {
            let mut frames = common::poll_blocks(session, 12);
            let other = if sampler == Sampler::Single { Sampler::Midpoint2 } else { Sampler::Single };
            session.set_sampler(other).expect("its flow times are in the table");
            frames.extend(common::poll_blocks(session, 12));
            frames
        };
        assert!(blocks(&mut a) == blocks(&mut b), "{sampler}");
    }
}

#[test]
fn flow_times_outside_the_table_take_the_weights() {
    let lean = load(Networks { modulation: false, ..Networks::default() }).expect("it loads");
    let clean = HistoryTime::Clean(CleanHistory { tau: 0.83, from: 0.4 });
    for options in [
        SessionOptions { sampler: Sampler::euler(3).unwrap(), ..Default::default() },
        SessionOptions { diagnostics: Diagnostics { history: clean, ..Default::default() }, ..Default::default() },
    ] {
        let refused = lean.session(options.clone()).expect_err("refused");
        assert_eq!(refused.kind(), ErrorKind::Argument);
        assert!(refused.to_string().contains("modulation weights"), "{refused}");
        tiny().session(options).expect("an engine with the weights has them all");
    }
    let mut session = lean.session(SessionOptions::default()).expect("session");
    session.set_sampler(Sampler::euler(3).unwrap()).expect_err("refused later too");
    session.set_sampler(Sampler::euler(8).unwrap()).expect("on the grid");
}

#[test]
fn it_takes_the_encoder_to_re_anchor() {
    for encoder in [true, false] {
        let engine = load(Networks { encoder, reference: false, ..Networks::default() }).expect("it loads");
        let options =
            SessionOptions { sampler: Sampler::Single, diagnostics: Anchoring::Every(4).into(), ..Default::default() };
        let mut session = engine.session(options).expect("session");
        common::poll_blocks(&mut session, 40);
        assert_eq!(session.stats().anchorings > 0, encoder);
    }
}

#[test]
fn what_is_missing_is_refused_by_name() {
    let all = Networks::default();
    let neither = load(Networks { reference: false, student: false, ..all }).expect_err("nothing to make motion with");
    assert_eq!(neither.kind(), ErrorKind::Argument);
    for (networks, sampler, missing) in [
        (Networks { reference: false, ..all }, Sampler::Midpoint4, "reference network"),
        (Networks { student: false, ..all }, Sampler::Single, "student network"),
    ] {
        let engine = load(networks).expect("it loads");
        let refused = engine.session(SessionOptions { sampler, ..Default::default() }).expect_err("refused");
        assert_eq!(refused.kind(), ErrorKind::Argument);
        assert!(refused.to_string().contains(missing), "{refused}");
        let other = if sampler == Sampler::Single { Sampler::Midpoint2 } else { Sampler::Single };
        let mut session = engine.session(SessionOptions { sampler: other, ..Default::default() }).expect("session");
        let refused = session.set_sampler(sampler).expect_err("refused later too");
        assert!(refused.to_string().contains(missing), "{refused}");
    }
}
