//! The module's interface, natively: the digests of motion that `tests/digests.test.js` compares
//! with, in `tests/digests.txt`. `VISAVIS_DIGESTS=write` rewrites it where numbers were meant to
//! change.

use crate::*;
use std::fmt::Write;
use std::path::Path;
use visavis::{BLOCK_FRAMES, Engine};

const AGENT_RATE: usize = 48_000;
const USER_RATE: usize = 16_000;

fn text() -> String {
    // SAFETY: the text of the last call, which nobody changes meanwhile.
    let bytes = unsafe { slice(visavis_text(), visavis_text_length()) };
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn engine(path: &str) -> *const Engine {
    let bytes = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)).unwrap();
    let mut status = 0;
    // SAFETY: bytes and status outlive the call.
    let engine = unsafe { visavis_engine_new(bytes.as_ptr(), bytes.len(), &mut status) };
    assert_eq!(status, 0, "{}", text());
    engine
}

fn session(engine: *const Engine, options: &str) -> Result<*mut Conversation, (i32, String)> {
    let mut status = 0;
    // SAFETY: all outlives the call.
    let session = unsafe { visavis_session_new(engine, options.as_ptr(), options.len(), &mut status) };
    if status == 0 { Ok(session) } else { Err((status, text())) }
}

/// Noise in bursts, of whole numbers: JavaScript makes the same (`tests/scene.js`).
fn voice(seed: u32, samples: usize, rate: usize) -> Vec<f32> {
    let mut state = seed;
    let noise = |i: usize| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let value = (state >> 16) as f32 / 65_536.0 - 0.5;
        if (4 * i / rate) % 3 == 2 { 0.0 } else { 0.5 * value }
    };
    (0..samples).map(noise).collect()
}

/// Sample `n` of a head that walks to and fro, 72 a second.
fn head(n: usize) -> [f64; 3] {
    let p = n % 576;
    let way = p.min(576 - p) as f64 / 144.0 - 1.0;
    [way, 1.6, 1.5 + 0.25 * way]
}

/// Its rotation there, by Pythagorean numbers: turned about the vertical on the way there, nodding
/// on the way back.
fn turned(n: usize) -> [f64; 4] {
    if n % 576 < 288 { [0.0, 0.8, 0.0, 0.6] } else { [0.28, 0.0, 0.0, 0.96] }
}

/// FNV-1a of 32-bit words in two lanes.
struct Digest([u32; 2]);

impl Digest {
    fn add(&mut self, word: u32) {
        self.0[0] = (self.0[0] ^ word).wrapping_mul(0x0100_0193);
        self.0[1] = (self.0[1] ^ word.rotate_left(16)).wrapping_mul(0x0100_0193);
    }
}

/// With `rotations` the head is pushed with its own, with `sounds` there is one in the room that
/// moves.
fn motion(engine: *const Engine, options: &str, blocks: usize, rotations: bool, sounds: bool) -> String {
    let conversation = session(engine, options).unwrap();
    // SAFETY: alive.
    let (joints, kind) = unsafe { ((*engine).rig().len(), (*engine).kind()) };
    let seconds = blocks * 4 / 30 + 1;
    let (agent, user) = (voice(1, seconds * AGENT_RATE, AGENT_RATE), voice(2, seconds * USER_RATE, USER_RATE));
    let mut digest = Digest([0x811c_9dc5, 0x811c_9dc5 ^ 0xffff]);
    // SAFETY: the session is alive until it is freed; the voices outlive the pushes.
    unsafe {
        for (number, voice, rate) in [(0, &agent, AGENT_RATE), (1, &user, USER_RATE)] {
            assert_eq!(visavis_push_voice(conversation, number, voice.as_ptr(), voice.len(), rate as u32), 0);
        }
        for x in [-2.0, 1.0].into_iter().filter(|_| sounds) {
            let sound = voice(3, USER_RATE, USER_RATE);
            let status =
                visavis_push_sound(conversation, 7, sound.as_ptr(), sound.len(), USER_RATE as u32, x, 1.0, -1.5);
            assert_eq!(status, 0, "{}", text());
        }
        for n in 0..seconds * 72 {
            let [x, y, z] = head(n).map(|v| v as f32);
            let time = n as f64 / 72.0;
            let [a, b, c, d] = turned(n).map(|v| v as f32);
            let status = match rotations {
                true => visavis_push_pose(conversation, x, y, z, a, b, c, d, time),
                false => visavis_push_head(conversation, x, y, z, time),
            };
            assert_eq!(status, 0);
        }
        for _ in 0..blocks {
            assert_eq!(visavis_poll(conversation, visavis_next_due(conversation)), 1, "{}", text());
            for v in slice(visavis_numbers(conversation), BLOCK_FRAMES * FRAME_NUMBERS) {
                // What is not a number has no bits that JavaScript would keep.
                let bits = if v.is_nan() { 0 } else { v.to_bits() };
                digest.add(bits as u32);
                digest.add((bits >> 32) as u32);
            }
            let shares = slice(visavis_shares(conversation), visavis_shares_length(conversation));
            assert_eq!(shares.len(), if kind == "dram" { BLOCK_FRAMES * joints } else { 0 });
            let joints = slice(visavis_joints(conversation), BLOCK_FRAMES * joints * JOINT_NUMBERS);
            joints.iter().chain(shares).for_each(|v| digest.add(v.to_bits()));
        }
        visavis_session_free(conversation);
    }
    format!("{:08x}{:08x}", digest.0[0], digest.0[1])
}

#[test]
fn motion_is_that_of_the_file_that_webassembly_is_compared_with() {
    let mut lines = String::from(
        "# Bundle, blocks, options, digest. src/tests.rs computes them; VISAVIS_DIGESTS=write rewrites.\n",
    );
    let tiny = "tests/goldens/tiny.safetensors";
    let shipped = "models/visavis-room-i8.safetensors";
    let cases = [
        (tiny, 24, r#"{"sampler":"midpoint4"}"#),
        (tiny, 24, r#"{"sampler":"midpoint2","gaze":0.8,"seed":7}"#),
        (tiny, 24, r#"{"sampler":"midpoint1","gaze":0.8}"#),
        (tiny, 24, r#"{"sampler":"euler:5","gaze":0.25,"guidance":3}"#),
        (tiny, 24, r#"{"sampler":"single","start":[1,2,0.5]}"#),
        ("tests/goldens/hearing.safetensors", 24, r#"{"gaze":0.8}"#),
        ("tests/goldens/hearing.safetensors", 24, r#"{"sampler":"single","sensitivity":-1.5}"#),
        ("tests/goldens/dram-tcn.safetensors", 40, r#"{"gaze":0.8}"#),
        ("tests/goldens/dram-lstm.safetensors", 40, "{}"),
        (shipped, 100, r#"{"sampler":"single"}"#),
        (shipped, 20, r#"{"sampler":"midpoint4","gaze":0.8}"#),
    ];
    let (mut engine_of, mut loaded) = ("", std::ptr::null());
    for (bundle, blocks, options) in cases {
        if bundle != engine_of {
            (engine_of, loaded) = (bundle, engine(bundle));
        }
        let digest = motion(loaded, options, blocks, bundle.contains("dram"), bundle.contains("hearing"));
        writeln!(lines, "{bundle} {blocks} {options} {digest}").unwrap();
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/digests.txt");
    if std::env::var("VISAVIS_DIGESTS").is_ok_and(|v| v == "write") {
        std::fs::write(&path, &lines).unwrap();
    }
    assert_eq!(lines, std::fs::read_to_string(path).unwrap(), "left: this machine; right: the file");
}

/// Blocks that come late are left to the featherweight tier, by block times that are told.
#[test]
fn late_blocks_are_left_to_the_fallback() {
    let (tiny, light) = (engine("tests/goldens/tiny.safetensors"), engine("tests/goldens/dram-tcn.safetensors"));
    let conversation = session(tiny, r#"{"budget":100}"#).unwrap();
    let other = session(light, "{}").unwrap();
    // SAFETY: what is not freed is alive.
    unsafe {
        assert_eq!(visavis_set_fallback(conversation, tiny), 1);
        assert!(text().contains("`dram`"), "{}", text());
        assert_eq!(visavis_set_fallback(other, light), 1, "{}", text());
        assert_eq!(visavis_set_fallback(conversation, light), 0, "{}", text());
        [tiny, light].into_iter().for_each(|engine| visavis_engine_free(engine));
        let mut fell = 0;
        for _ in 0..60 {
            assert_eq!(visavis_poll(conversation, visavis_next_due(conversation)), 1, "{}", text());
            let told = visavis_shares_length(conversation) > 0;
            fell += i32::from(told);
            assert_eq!(visavis_report_block_time(conversation, if told { 5.0 } else { 99_999.0 }), 0);
        }
        visavis_stats(conversation);
        let counted = format!(r#""heldBlocks":0,"fallbackBlocks":{fell},"#);
        assert!(fell > 0 && text().contains(&counted), "{fell}, {}", text());
        assert_eq!(visavis_report_block_time(conversation, -1.0), 1, "{}", text());
        visavis_session_free(conversation);
        visavis_session_free(other);
    }
}

#[test]
fn sounds_that_are_wrong_have_a_status_and_are_counted() {
    let hearing = engine("tests/goldens/hearing.safetensors");
    let conversation = session(hearing, r#"{"sampler":"single"}"#).unwrap();
    let sound = [0.0, f32::NAN, 65.0];
    // SAFETY: what is not freed is alive; the sound outlives the pushes.
    unsafe {
        visavis_engine_facts(hearing);
        assert!(text().contains(r#""hasHearing":true"#), "{}", text());
        let push = |count, rate, x| visavis_push_sound(conversation, 1, sound.as_ptr(), count, rate, x, 1.0, 2.0);
        let mut place = [f32::NAN; 3];
        assert_eq!(visavis_heard_place(conversation, place.as_mut_ptr()), 0);
        assert!(place.iter().all(|v| v.is_nan()), "{place:?}");
        assert_eq!(push(1, 24_000, f32::INFINITY), 1, "{}", text());
        assert_eq!(push(1, 0, 0.0), 6, "{}", text());
        assert_eq!(push(3, 24_000, 0.0), 6, "{}", text());
        assert_eq!(visavis_poll(conversation, 0.0), 1);
        // A block hears what was heard before it.
        assert_eq!(visavis_heard_place(conversation, place.as_mut_ptr()), 0);
        assert_eq!(visavis_poll(conversation, visavis_next_due(conversation)), 1);
        assert_eq!((visavis_heard_place(conversation, place.as_mut_ptr()), place), (1, [0.0, 1.0, 2.0]));
        assert_eq!(visavis_end_sound(conversation, 1), 0);
        assert_eq!(visavis_push_ears(conversation, [0.0_f32; 8].as_ptr(), 4, 7_999), 6, "{}", text());
        assert_eq!(visavis_push_ears(conversation, [0.0_f32; 8].as_ptr(), 4, 24_000), 0);
        assert_eq!(visavis_end_ears(conversation), 0);
        visavis_stats(conversation);
        let counted = r#""sounds":{"pieces":2,"started":1,"overflowSamples":0,"clippedSamples":1,"nonFiniteSamples":1,"badRateSamples":9,"badPlaces":1,"#;
        assert!(text().contains(counted), "{}", text());
        visavis_session_free(conversation);
        visavis_engine_free(hearing);
    }
}

#[test]
fn what_is_wrong_has_a_status_and_a_text() {
    let mut status = 0;
    // SAFETY: all outlives the calls; what is not null is alive.
    unsafe {
        assert!(visavis_engine_new(b"no bundle".as_ptr(), 9, &mut status).is_null());
        assert_eq!(status, 3, "{}", text());
        let engine = engine("tests/goldens/tiny.safetensors");
        visavis_engine_facts(engine);
        assert!(text().contains(r#""fps":30,"blockFrames":4"#), "{}", text());
        assert!(text().contains(r#""kind":"sarah""#), "{}", text());
        for (options, part) in [
            ("{", "options of the session"),
            (r#"{"colour":1}"#, "unknown field `colour`"),
            (r#"{"sampler":"best"}"#, "unknown sampler"),
            (r#"{"gaze":2}"#, "gaze target 2"),
            (r#"{"voiceAhead":0.4}"#, "voice_ahead is 0.4"),
            (r#"{"sensitivity":2}"#, "sensitivity"),
        ] {
            let (status, text) = session(engine, options).unwrap_err();
            assert_eq!(status, 1);
            assert!(text.contains(part), "{text}");
        }
        let conversation = session(engine, "{}").unwrap();
        visavis_engine_free(engine);
        assert_eq!(visavis_push_voice(conversation, 0, [0.0_f32; 4].as_ptr(), 4, 1), 6, "{}", text());
        assert_eq!(visavis_push_voice(conversation, 2, std::ptr::null(), 0, 48_000), 1, "{}", text());
        assert_eq!(visavis_push_sound(conversation, 1, [0.0_f32; 4].as_ptr(), 4, 24_000, 0.0, 1.0, 2.0), 1);
        assert!(text().contains("hearing"), "{}", text());
        assert_eq!(visavis_end_sound(conversation, 1), 1, "{}", text());
        assert_eq!(visavis_push_ears(conversation, [0.0_f32; 8].as_ptr(), 4, 24_000), 1, "{}", text());
        assert_eq!(visavis_end_ears(conversation), 1, "{}", text());
        assert_eq!(visavis_heard_place(conversation, [0.0_f32; 3].as_mut_ptr()), 0);
        assert_eq!(visavis_set_sensitivity(conversation, f32::NAN), 1, "{}", text());
        assert_eq!(visavis_set_sensitivity(conversation, -1.0), 0);
        assert_eq!(visavis_poll(conversation, f64::NAN), -1, "{}", text());
        assert_eq!(visavis_poll(conversation, 0.0), 1);
        assert_eq!(visavis_poll(conversation, 0.0), 0);
        visavis_stats(conversation);
        assert!(text().contains(r#""blocks":1,"#), "{}", text());
        visavis_session_free(conversation);
        let memory = visavis_alloc(13);
        assert!(memory.cast::<u64>().is_aligned());
        visavis_free(memory, 13);
    }
}
