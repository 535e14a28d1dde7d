//! What a session promises: same bits however inputs come, nothing known before its time, seeds
//! that matter.

mod common;

use common::{Inputs, dram, golden_path, motion, motion_of, poll_blocks, run, tiny};
use glam::Vec3;
use std::sync::Arc;
use visavis::internals::config::StudentConfig;
use visavis::internals::session::{Diagnostics, Probe};
use visavis::{BLOCK_FRAMES, BundleFile, Engine, ErrorKind, FPS, Frame, Sampler, Session, SessionOptions, Speaker};

const BLOCKS: usize = 30;

fn options() -> SessionOptions {
    SessionOptions { gaze: Some(0.8), ..Default::default() }
}

fn inputs() -> Inputs {
    Inputs::circling(common::block_seconds(BLOCKS), 24_000)
}

/// Drives a session as an application does: each block's inputs in pieces, interleaved by `order`.
fn live(session: &mut Session, inputs: &Inputs, piece: usize, order: u32) -> Vec<Frame> {
    let (mut agent, mut user) = (inputs.agent.chunks(piece), inputs.user.chunks(piece + 7));
    let mut path = inputs.path.iter().peekable();
    let (mut sent_agent, mut sent_user, mut frames) = (0, 0, Vec::new());
    for block in 0..BLOCKS {
        let start = common::block_seconds(block);
        let samples = |seconds: f64| (seconds * f64::from(inputs.rate)) as usize;
        let (agent_needs, user_needs) = (samples(start + common::block_seconds(1)), samples(start));
        loop {
            let mut moved = false;
            for turn in 0..3 {
                match (turn + order) % 3 {
                    0 if sent_agent < agent_needs => {
                        if let Some(chunk) = agent.next() {
                            session.push_agent_audio(chunk, inputs.rate).unwrap();
                            sent_agent += chunk.len();
                            moved = true;
                        }
                    }
                    1 if sent_user < user_needs => {
                        if let Some(chunk) = user.next() {
                            session.push_user_audio(chunk, inputs.rate).unwrap();
                            sent_user += chunk.len();
                            moved = true;
                        }
                    }
                    2 => {
                        if let Some((time, position)) = path.next_if(|(time, _)| *time <= start) {
                            session.push_user_head(*position, *time).unwrap();
                            moved = true;
                        }
                    }
                    _ => {}
                }
            }
            if !moved {
                break;
            }
        }
        frames.extend_from_slice(session.poll(start).unwrap().unwrap());
    }
    frames
}

#[test]
fn chunking_and_interleaving_do_not_change_a_bit() {
    for engine in [tiny(), dram("tcn"), dram("lstm")] {
        chunked(&engine);
    }
}

fn chunked(engine: &std::sync::Arc<visavis::Engine>) {
    let inputs = inputs();
    // A voice is absent until its first push; both make their appearance before the first block
    // here.
    let present = || {
        let session = engine.session(options()).unwrap();
        session.voice_input(Speaker::Agent).set_present(true);
        session.voice_input(Speaker::User).set_present(true);
        session
    };
    let whole = run(&mut present(), &inputs, BLOCKS);
    for (piece, order) in [(1, 0), (13, 1), (240, 2), (800, 0), (5000, 1)] {
        let frames = live(&mut present(), &inputs, piece, order);
        assert_eq!(frames.len(), whole.len());
        for (a, b) in frames.iter().zip(&whole) {
            // The gaze of a frame is measured against the head as known by then; it does not steer.
            assert_eq!(
                (a.root, &a.global, &a.local, &a.dyadic),
                (b.root, &b.global, &b.local, &b.dyadic),
                "chunks of {piece}, frame {}",
                a.index
            );
        }
    }
}

/// What no flow model has: the read-out, and a rotation of the user's head.
#[test]
fn the_featherweight_tier_tells_whom_the_body_follows() {
    let inputs = inputs();
    for backbone in ["tcn", "lstm"] {
        let engine = dram(backbone);
        let frames = motion_of(&engine, options(), &inputs, BLOCKS);
        let shares = || frames.iter().flat_map(|frame| frame.dyadic.iter().copied());
        assert!(frames.iter().all(|frame| frame.dyadic.len() == engine.rig().len()));
        assert!(shares().all(|share| (0.0..=1.0).contains(&share)) && shares().any(|share| share > 1e-3));
        // What makes no sense to it changes nothing.
        let other = SessionOptions {
            seed: 9,
            sampler: Sampler::euler(3).unwrap(),
            guidance: Some(3.0),
            temperature: Some(0.1),
            threads: 2,
            ..options()
        };
        let same = motion_of(&engine, other, &inputs, BLOCKS);
        assert!(frames.iter().zip(&same).all(|(a, b)| (&a.global, &a.dyadic) == (&b.global, &b.dyadic)));
        assert_ne!(motion_of(&engine, SessionOptions { gaze: None, ..options() }, &inputs, BLOCKS), frames);
        let turned = |engine: &std::sync::Arc<visavis::Engine>| {
            let mut session = engine.session(options()).unwrap();
            for (time, position) in &inputs.path {
                let nod = glam::Quat::from_rotation_x(0.3 * (9.0 * *time as f32).sin());
                session.push_user_pose(*position, Some(nod), *time).unwrap();
            }
            poll_blocks(&mut session, BLOCKS)
        };
        let still = Inputs { agent: Vec::new(), user: Vec::new(), ..inputs.clone() };
        assert_ne!(turned(&engine), motion_of(&engine, options(), &still, BLOCKS));
        assert_eq!(turned(&tiny()), motion(options(), &still, BLOCKS), "the flow model does not look at it");
        assert!(turned(&tiny()).iter().all(|frame| frame.dyadic.is_empty()));
    }
    let mut session = dram("tcn").session(options()).unwrap();
    assert_eq!(session.reset_with_noise(vec![0.0; 4096]).unwrap_err().kind(), ErrorKind::Argument);
    session.set_sampler(Sampler::Single).unwrap();
    session.set_guidance(2.0, 2.0).unwrap();
    assert!(session.stats().cache_bytes < 64 << 10);
    // A long gap leaves no trace once it is reset.
    let first = run(&mut session, &inputs, BLOCKS);
    session.reset().unwrap();
    assert_eq!(run(&mut session, &inputs, BLOCKS), first);
}

#[test]
fn chunking_does_not_change_a_bit_when_resampling() {
    let engine = tiny();
    let inputs = Inputs::circling(common::block_seconds(BLOCKS), 44_100);
    let whole = run(&mut engine.session(options()).unwrap(), &inputs, BLOCKS);
    for piece in [1usize, 441, 3000] {
        let mut session = engine.session(options()).unwrap();
        inputs.agent.chunks(piece).for_each(|c| session.push_agent_audio(c, inputs.rate).unwrap());
        inputs.user.chunks(piece).for_each(|c| session.push_user_audio(c, inputs.rate).unwrap());
        inputs.path.iter().for_each(|(t, p)| session.push_user_head(*p, *t).unwrap());
        assert_eq!(poll_blocks(&mut session, BLOCKS), whole, "chunks of {piece}");
    }
}

#[test]
fn same_seed_same_bits_with_one_or_two_threads() {
    let inputs = inputs();
    let one = motion(options(), &inputs, BLOCKS);
    assert_eq!(motion(options(), &inputs, BLOCKS), one);
    assert_eq!(motion(SessionOptions { threads: 2, ..options() }, &inputs, BLOCKS), one);
}

#[test]
fn reset_replays() {
    let inputs = inputs();
    let mut session = tiny().session(options()).unwrap();
    let first = run(&mut session, &inputs, BLOCKS);
    session.reset().unwrap();
    assert_eq!(run(&mut session, &inputs, BLOCKS), first);
}

#[test]
fn seeds_and_gaze_targets_matter() {
    let inputs = inputs();
    let base = motion(options(), &inputs, 8);
    let differs = |other: SessionOptions| {
        let frames = motion(other, &inputs, 8);
        base.iter().zip(&frames).any(|(a, b)| a.global != b.global)
    };
    assert!(differs(SessionOptions { seed: 1, ..options() }));
    assert!(differs(SessionOptions { gaze: Some(0.0), ..options() }));
    assert!(differs(SessionOptions { stance: false, ..options() }));
    let diagnostics = Diagnostics { bridge: false, ..Default::default() };
    assert!(differs(SessionOptions { diagnostics, ..options() }));
    assert!(differs(SessionOptions { gaze: None, ..options() }));
    assert!(differs(SessionOptions { sampler: Sampler::Midpoint2, ..options() }));
    assert!(differs(SessionOptions { guidance: Some(3.0), ..options() }));
}

/// Changing an input after time t changes no frame before t, and does change something later.
#[test]
fn causality() {
    let inputs = inputs();
    let base = motion(options(), &inputs, BLOCKS);
    let cut = 17;
    let start = common::block_seconds(cut);
    let sample = (start * f64::from(inputs.rate)) as usize;

    // The agent's own voice is known through its block: a change in block `cut` may show from that
    // block on.
    let mut agent = inputs.clone();
    agent.agent[sample..].iter_mut().for_each(|s| *s = 0.3 - *s);
    // What the user does from the start of block `cut - 1` on may show from block `cut` on.
    let heard = ((start - common::block_seconds(1)) * f64::from(inputs.rate)) as usize;
    let mut user = inputs.clone();
    user.user[heard..].iter_mut().for_each(|s| *s = 0.3 - *s);
    let mut path = inputs.clone();
    let seen = start - common::block_seconds(1);
    path.path.iter_mut().filter(|(t, _)| *t > seen).for_each(|(_, p)| *p += Vec3::new(0.5, 0.0, -0.3));

    for (name, changed) in [("agent voice", agent), ("user voice", user), ("user path", path)] {
        let frames = motion(options(), &changed, BLOCKS);
        let first = base.iter().zip(&frames).position(|(a, b)| a.global != b.global || a.root != b.root);
        assert_eq!(first, Some(cut * BLOCK_FRAMES), "{name}: first frame that changed");
    }
}

/// A sampler that rests finds its caches behind and catches up: exactly, as long as it rests less
/// than a window.
#[test]
fn switching_samplers_and_back_is_as_if_the_caches_had_been_kept() {
    let engine = tiny();
    let inputs = inputs();
    let frames = |switch_back: usize| {
        let mut session = engine.session(options()).unwrap();
        let mut frames = run(&mut session, &inputs, 6);
        session.set_sampler(Sampler::Single).unwrap();
        frames.extend(poll_blocks(&mut session, switch_back));
        session.set_sampler(Sampler::Midpoint4).unwrap();
        frames.extend(poll_blocks(&mut session, 20 - switch_back));
        frames
    };
    for blocks in [1, 3, 12] {
        let f = frames(blocks);
        assert!(f.iter().all(|f| f.global.iter().all(|t| t.position.is_finite())));
        assert_eq!(f[24].sampler, Sampler::Single);
        assert_eq!(f[24 + 4 * blocks].sampler, Sampler::Midpoint4);
    }
}

#[test]
fn time_and_frames_are_consecutive() {
    let mut session = tiny().session(options()).unwrap();
    assert!(session.poll(0.0).unwrap().is_some());
    assert!(session.poll(0.1).unwrap().is_none(), "block 1 is due at 0.133 s");
    let mut frames = Vec::new();
    while let Some(four) = session.poll(1.0).unwrap() {
        frames.extend_from_slice(four);
    }
    // Blocks 1 to 7 are due by 1.0 s (block 7 at 0.933 s).
    assert_eq!(frames.len(), 28);
    for (i, f) in frames.iter().enumerate() {
        assert_eq!(f.index, i as u64 + 4);
        assert!((f.time - f.index as f64 / f64::from(FPS)).abs() < 1e-12);
    }
    assert_eq!(session.poll(0.5).unwrap_err().kind(), ErrorKind::State);
    assert_eq!(session.poll(f64::NAN).unwrap_err().kind(), ErrorKind::Argument);
    assert!(session.poll(1.2).unwrap().is_some(), "a refused call changes nothing");
}

#[test]
fn bad_arguments_are_typed_errors_and_change_nothing() {
    let engine = tiny();
    let kind = |options: SessionOptions| engine.session(options).err().map(|e| e.kind());
    assert_eq!(kind(SessionOptions { threads: 0, ..options() }), Some(ErrorKind::Argument));
    assert_eq!(kind(SessionOptions { threads: 3, ..options() }), Some(ErrorKind::Argument));
    assert_eq!(kind(SessionOptions { gaze: Some(f32::NAN), ..options() }), Some(ErrorKind::Argument));
    assert_eq!(kind(SessionOptions { guidance: Some(-1.0), ..options() }), Some(ErrorKind::Argument));

    let mut session = engine.session(options()).unwrap();
    assert_eq!(session.set_gaze(Some(2.0)).unwrap_err().kind(), ErrorKind::Argument);
    assert_eq!(session.set_guidance(1.0, f32::INFINITY).unwrap_err().kind(), ErrorKind::Argument);
    assert_eq!(session.set_sampler(Sampler::euler(5).unwrap()).unwrap_err().kind(), ErrorKind::Argument);
    assert_eq!(session.push_agent_audio(&[0.0], 0).unwrap_err().kind(), ErrorKind::Audio);
    assert_eq!(session.options(), &options());
    session.push_user_head(Vec3::NAN, 0.0).unwrap();
    assert_eq!(session.stats().inputs.head.non_finite, 1);
    let plain = engine.session(options()).unwrap().poll(0.0).unwrap().unwrap().to_vec();
    assert_eq!(session.poll(0.0).unwrap().unwrap(), plain);
}

#[test]
fn euler_with_its_own_flow_times() {
    let options = SessionOptions { sampler: Sampler::euler(5).unwrap(), ..options() };
    let mut session = tiny().session(options).unwrap();
    let frames = run(&mut session, &inputs(), 10);
    assert_eq!(frames[0].sampler, Sampler::euler(5).unwrap());
    assert!(session.set_sampler(Sampler::euler(8).unwrap()).is_ok(), "eighths are always there");
    assert!(session.set_sampler(Sampler::euler(5).unwrap()).is_ok());
}

#[test]
fn absent_is_not_silent() {
    let mut inputs = inputs();
    inputs.agent.fill(0.0);
    let silent = motion(options(), &inputs, 8);
    inputs.agent.clear();
    let absent = motion(options(), &inputs, 8);
    assert_ne!(silent[0].global, absent[0].global);
}

/// Temperature scales the seeded noise: at 0 nothing is left of the seed, at 1 it is the noise that
/// was trained with.
#[test]
fn temperature_scales_the_noise() {
    let inputs = inputs();
    let run =
        |seed, temperature| motion(SessionOptions { seed, temperature: Some(temperature), ..options() }, &inputs, 6);
    assert_eq!(run(1, 0.0), run(2, 0.0));
    assert_ne!(run(1, 0.5)[0].global, run(2, 0.5)[0].global);
    assert_ne!(run(1, 0.5)[0].global, run(1, 1.0)[0].global);
    let refused = tiny().session(SessionOptions { temperature: Some(-0.1), ..options() });
    assert_eq!(refused.unwrap_err().kind(), ErrorKind::Argument);
}

/// A bundle may give its student a temperature of its own: blocks of the single step go by it, all
/// others and whoever asks for one do not.
#[test]
fn the_single_step_may_have_a_temperature_of_its_own() {
    let inputs = inputs();
    let mut config = tiny().config().clone();
    config.student = config.student.map(|student| StudentConfig { temperature: Some(0.5), ..student });
    let bytes = BundleFile::open(golden_path("tiny.safetensors")).unwrap().with_settings(&config).unwrap();
    let own = Engine::from_bytes(bytes, "own").unwrap();
    let at = |engine: &Arc<Engine>, sampler, temperature| {
        let options = SessionOptions { sampler, temperature, ..options() };
        run(&mut engine.session(options).unwrap(), &inputs, 6)
    };
    let usual = config.session.temperature;
    assert_ne!(usual, 0.5);
    assert_eq!(at(&own, Sampler::Single, None), at(&tiny(), Sampler::Single, Some(0.5)));
    assert_eq!(at(&own, Sampler::Single, Some(usual)), at(&tiny(), Sampler::Single, None));
    assert_eq!(at(&own, Sampler::Midpoint2, None), at(&tiny(), Sampler::Midpoint2, None));
}

#[test]
fn warming_up_leaves_no_trace() {
    let inputs = inputs();
    // Masks are refused where there are none.
    let core_mask = cfg!(target_os = "linux").then_some(u64::MAX);
    let options = || SessionOptions { threads: 2, core_mask, ..options() };
    let mut session = tiny().session(options()).unwrap();
    session.push_agent_audio(&[0.5; 4800], 24_000).unwrap();
    session.warm_up(3).unwrap();
    assert_eq!((session.stats().blocks, session.next_due()), (0, 0.0));
    assert_eq!(run(&mut session, &inputs, 6), motion(options(), &inputs, 6));
    let one = tiny().session(SessionOptions { threads: 1, core_mask: Some(0), ..options() }).unwrap();
    assert_eq!(one.worker_thread_ids().count(), 0, "nobody to pin");
    if cfg!(target_os = "linux") {
        assert_eq!(session.worker_thread_ids().count(), 1);
        let refused = tiny().session(SessionOptions { core_mask: Some(0), ..options() });
        assert_eq!(refused.unwrap_err().kind(), ErrorKind::Argument);
    }
}

/// Counts what is told of features, block by block.
#[derive(Default)]
struct Decoded(Vec<u64>);

impl Probe for Decoded {
    fn stage(&mut self, block: u64, name: &'static str, values: &[f32]) {
        if name == "decoded" {
            assert!(values.iter().all(|v| v.is_finite()));
            self.0.push(block);
        }
    }
}

/// Numbers that are no latent: the guard answers for the block, nothing of them stays, and motion
/// comes back.
#[test]
fn an_unusable_latent_is_a_block_without_features() {
    let engine = tiny();
    let (idle, latent) = (engine.idle_blocks(), engine.config().vae.latent);
    for (sampler, rubbish) in
        [(Sampler::Midpoint4, f32::NAN), (Sampler::Midpoint2, f32::INFINITY), (Sampler::Single, f32::NAN)]
    {
        let mut noise = vec![0.1; (idle + 5) * latent];
        noise.extend(vec![rubbish; latent]);
        let mut session = engine.session(SessionOptions { sampler, ..Default::default() }).unwrap();
        session.reset_with_noise(noise).unwrap();
        let (mut decoded, mut frames) = (Decoded::default(), Vec::new());
        for _ in 0..14 {
            let now = session.next_due();
            frames.extend_from_slice(session.poll_with(now, Some(&mut decoded)).unwrap().unwrap());
        }
        let expected: Vec<u64> = (0..14).filter(|block| *block != 5).collect();
        assert_eq!(decoded.0, expected, "{sampler}");
        assert!(frames[20..24].iter().all(|f| f.held == 1.0), "{sampler}");
        assert!(frames.iter().flat_map(|f| &f.global).all(|t| t.position.is_finite() && t.rotation.is_finite()));
        assert_eq!(frames.last().unwrap().held, 0.0, "{sampler}");
        assert_eq!(session.stats().guard.non_finite, 4, "{sampler}");
    }
}
