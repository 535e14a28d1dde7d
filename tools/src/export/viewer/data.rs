//! The recording as JSON for the page: small things as they are, tracks as base64 of little-endian
//! numbers.

use super::Meta;
use crate::metrics::foot_clearances;
use crate::recording::{Recording, Sounds, Source};
use glam::{Quat, Vec3};
use serde_json::{Value, json};
use visavis::{BLOCK_FRAMES, FPS, Frame, SAMPLE_RATE, Sampler};

/// Decoded joint positions are stored relative to the root in steps of this, metres: +-6.5 m in 16
/// bits.
const STEP: f32 = 0.0002;
/// A foot nearer to the floor than this is marked as touching it, metres.
const TOUCH: f64 = 0.03;
/// What stands for a share in a frame that does not tell whom its joints follow; shares are in
/// 254ths.
const UNTOLD: u8 = 255;

/// Everything the page reads, as JSON that is safe inside a `<script>` element: no `<` in it.
pub fn json(recording: &Recording, meta: &Meta) -> String {
    let (rig, frames) = (&recording.rig, recording.frames.as_slice());
    let mut samplers: Vec<Sampler> = Vec::new();
    let used: Vec<u8> = frames
        .iter()
        .map(|frame| {
            let known = samplers.iter().position(|s| *s == frame.sampler);
            let index = known.unwrap_or_else(|| {
                samplers.push(frame.sampler);
                samplers.len() - 1
            });
            u8::try_from(index).unwrap_or(u8::MAX)
        })
        .collect();
    let touching = foot_clearances(rig, frames);
    let touch: Vec<u8> = touching.iter().map(|[l, r]| u8::from(*l < TOUCH) | (u8::from(*r < TOUCH) << 1)).collect();
    let none = [f32::NAN; 3];
    let value = json!({
        "title": meta.title,
        "subtitle": meta.subtitle,
        "facts": meta.facts,
        "fps": FPS,
        "blockFrames": BLOCK_FRAMES,
        "frames": frames.len(),
        "start": frames.first().map_or(0, |frame| frame.index),
        "joints": rig.joints,
        "eyes": rig.eyes,
        "headBack": rig.head_back,
        "gazeTarget": recording.gaze_target,
        "samplers": samplers.iter().map(|s| meta.method.clone().unwrap_or_else(|| sampler_name(*s))).collect::<Vec<_>>(),
        "step": STEP,
        "root": floats(frames.iter().flat_map(|f| [f.root.x as f32, f.root.z as f32, f.root.yaw as f32])),
        "hips": floats(frames.iter().flat_map(|f| f.hips.to_array())),
        "local": shorts(frames.iter().flat_map(|f| rotations(f, rig.joints.len()))),
        "decoded": shorts(frames.iter().flat_map(|f| positions(f, rig.joints.len()))),
        "fit": floats(frames.iter().map(|f| f.fit_error)),
        "dyadic": dyadic(frames, rig.joints.len()),
        "gaze": floats(frames.iter().map(|f| f.gaze.unwrap_or(f32::NAN))),
        "sampler": base64(&used),
        "touch": base64(&touch),
        "user": floats((0..frames.len()).flat_map(|i| recording.user.get(i).copied().flatten().map_or(none, |p| p.to_array()))),
        "audioRate": SAMPLE_RATE / 2,
        "agentVoice": voice(recording.agent_voice.as_deref()),
        "userVoice": voice(recording.user_voice.as_deref()),
        "sounds": recording.sounds.as_ref().map(sources),
        "heard": voice(recording.sounds.as_ref().map(|sounds| sounds.heard.as_slice())),
    });
    // '<' occurs in JSON only inside strings, where it may be written as an escape.
    value.to_string().replace('<', "\\u003c")
}

/// Sources of sound: what, where, and from when to when in seconds.
fn sources(sounds: &Sounds) -> Value {
    let source = |s: &Source| json!({ "name": s.name, "at": s.position.to_array(), "seconds": s.seconds });
    sounds.sources.iter().map(source).collect()
}

fn sampler_name(sampler: Sampler) -> String {
    match sampler {
        Sampler::Single => "single step".to_owned(),
        Sampler::Euler(steps) => format!("Euler {}", steps.get()),
        midpoint => format!("midpoint {}", midpoint.steps()),
    }
}

/// How much each joint follows the user, a byte each, or null where no frame tells.
fn dyadic(frames: &[Frame], joints: usize) -> Value {
    let tells = |frame: &Frame| joints > 0 && frame.dyadic.len() == joints;
    if !frames.iter().any(tells) {
        return Value::Null;
    }
    let mut shares = vec![UNTOLD; frames.len() * joints];
    for (to, frame) in shares.chunks_exact_mut(joints).zip(frames).filter(|(_, frame)| tells(frame)) {
        to.iter_mut().zip(&frame.dyadic).for_each(|(to, share)| *to = (share * 254.0).round() as u8);
    }
    base64(&shares).into()
}

/// Local rotations as 16-bit fractions; a joint the frame lacks is unrotated.
fn rotations(frame: &Frame, joints: usize) -> impl Iterator<Item = i16> {
    (0..joints).flat_map(|j| {
        let rotation = frame.local.get(j).copied().unwrap_or(Quat::IDENTITY);
        rotation.to_array().map(|x| (x * 32767.0).round() as i16)
    })
}

/// Decoded positions relative to the root, along the world's axes, in [`STEP`]s.
fn positions(frame: &Frame, joints: usize) -> impl Iterator<Item = i16> {
    let root = Vec3::new(frame.root.x as f32, 0.0, frame.root.z as f32);
    (0..joints).flat_map(move |j| {
        let position = frame.global.get(j).map_or(root, |t| t.position) - root;
        position.to_array().map(|x| (x / STEP).round() as i16)
    })
}

/// A voice at half the rate as 16-bit samples, or null.
fn voice(samples: Option<&[f32]>) -> Value {
    samples
        .map_or(Value::Null, |samples| shorts(halved(samples).into_iter().map(|x| (x * 32767.0).round() as i16)).into())
}

/// Every second sample after a 31-tap half-band low-pass (Hann-windowed sinc, centred, so without
/// delay).
fn halved(samples: &[f32]) -> Vec<f32> {
    const REACH: i64 = 15;
    let tap = |k: i64| {
        let x = k as f32;
        let sinc = if k == 0 { 0.5 } else { (0.5 * std::f32::consts::PI * x).sin() / (std::f32::consts::PI * x) };
        sinc * 0.5 * (1.0 + (std::f32::consts::PI * x / (REACH + 1) as f32).cos())
    };
    let taps: Vec<f32> = (-REACH..=REACH).map(tap).collect();
    let gain: f32 = taps.iter().sum();
    let at = |i: i64| usize::try_from(i).ok().and_then(|i| samples.get(i)).copied().unwrap_or(0.0);
    let centre = |c: usize| taps.iter().zip(-REACH..).map(|(t, k)| t * at(c as i64 + k)).sum::<f32>() / gain;
    (0..samples.len()).step_by(2).map(centre).collect()
}

fn floats(values: impl Iterator<Item = f32>) -> String {
    base64(&values.flat_map(f32::to_le_bytes).collect::<Vec<_>>())
}

fn shorts(values: impl Iterator<Item = i16>) -> String {
    base64(&values.flat_map(i16::to_le_bytes).collect::<Vec<_>>())
}

/// Base64 with padding (RFC 4648, 4).
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let group = chunk.iter().fold(0_u32, |g, &b| (g << 8) | u32::from(b)) << (8 * (3 - chunk.len()));
        for i in 0..4 {
            let digit = ALPHABET[(group >> (18 - 6 * i)) as usize & 63];
            out.push(if i <= chunk.len() { char::from(digit) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use visavis::{Joint, Rig, Root};

    fn unbase64(text: &str) -> Vec<u8> {
        let digit = |c: u8| match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => panic!("{c}"),
        };
        let mut out = Vec::new();
        for group in text.as_bytes().chunks(4) {
            let digits: Vec<u8> = group.iter().filter(|&&c| c != b'=').map(|&c| digit(c)).collect();
            let bits = digits.iter().fold(0_u32, |b, &d| (b << 6) | u32::from(d)) << (6 * (4 - digits.len()));
            out.extend(&bits.to_be_bytes()[1..digits.len()]);
        }
        out
    }

    fn f32s(value: &Value) -> Vec<f32> {
        let bytes = unbase64(value.as_str().unwrap());
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    fn i16s(value: &Value) -> Vec<i16> {
        let bytes = unbase64(value.as_str().unwrap());
        bytes.chunks_exact(2).map(|b| i16::from_le_bytes(b.try_into().unwrap())).collect()
    }

    fn recording() -> Recording {
        let joint = |name: &str, parent, offset| Joint { name: name.into(), parent, offset };
        let joints = vec![joint("hips", None, [0.0, 0.9, 0.0]), joint("leftFoot", Some(0), [0.1, -0.8, 0.0])];
        let rig = Rig { joints, eyes: [0.0, 0.1, 0.1], head_back: [0.0, 0.1, -0.1] };
        let mut frames = vec![Frame::empty(2); 3];
        for (i, frame) in frames.iter_mut().enumerate() {
            frame.index = 8 + i as u64;
            frame.root = Root { x: 1.5, z: -2.0, yaw: 0.25 };
            frame.hips = Vec3::new(1.5, 0.9, -2.0);
            frame.global[0].position = frame.hips;
            frame.global[1].position = Vec3::new(1.6, 0.1 + 0.1 * i as f32, -2.0);
            frame.local[1] = Quat::from_rotation_x(0.5);
            frame.sampler = if i == 2 { Sampler::Single } else { Sampler::Midpoint4 };
        }
        frames[1].gaze = Some(0.75);
        let user = vec![None, Some(Vec3::new(0.1, 1.6, 2.0)), None];
        let agent_voice = Some((0..2400).map(|i| 0.5 * (f64::from(i) * 0.05).sin() as f32).collect());
        Recording { rig, frames, user, agent_voice, user_voice: None, gaze_target: Some(0.5), sounds: None }
    }

    fn parsed(recording: &Recording, meta: &Meta) -> Value {
        serde_json::from_str(&json(recording, meta)).unwrap()
    }

    #[test]
    fn base64_of_the_rfc() {
        for (plain, coded) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
        let all: Vec<u8> = (0..=255).rev().collect();
        assert_eq!(unbase64(&base64(&all)), all);
    }

    #[test]
    fn tracks_come_back() {
        let r = recording();
        let v = parsed(&r, &Meta::default());
        assert_eq!((v["frames"].as_u64(), v["start"].as_u64()), (Some(3), Some(8)));
        assert_eq!(f32s(&v["hips"])[3..6], [1.5, 0.9, -2.0]);
        assert_eq!(f32s(&v["root"])[..3], [1.5, -2.0, 0.25]);
        let local = i16s(&v["local"]);
        assert_eq!(local.len(), 3 * 2 * 4);
        assert!((f32::from(local[4]) / 32767.0 - 0.25_f32.sin()).abs() < 2e-5);
        let decoded = i16s(&v["decoded"]);
        assert!((f32::from(decoded[6 + 4]) * STEP - 0.2).abs() < STEP);
        assert!(v["dyadic"].is_null() && v["sounds"].is_null() && v["heard"].is_null());
        let source = Source { name: "bang".into(), position: Vec3::new(2.0, 0.5, -3.0), seconds: [1.0, 2.5] };
        let sounds = Some(Sounds { sources: vec![source], heard: vec![0.0; 240] });
        let loud = parsed(&Recording { sounds, ..r.clone() }, &Meta::default());
        assert_eq!(loud["sounds"], json!([{ "name": "bang", "at": [2.0, 0.5, -3.0], "seconds": [1.0, 2.5] }]));
        assert_eq!(i16s(&loud["heard"]), [0; 120]);
        let mut told = r.clone();
        told.frames.iter_mut().for_each(|frame| frame.dyadic = vec![0.0, 1.0]);
        assert_eq!(unbase64(parsed(&told, &Meta::default())["dyadic"].as_str().unwrap()), [0, 254, 0, 254, 0, 254]);
        told.frames[1].dyadic.clear();
        assert_eq!(unbase64(parsed(&told, &Meta::default())["dyadic"].as_str().unwrap()), [0, 254, 255, 255, 0, 254]);
        let user = f32s(&v["user"]);
        assert!(user[0].is_nan());
        assert_eq!(user[3..6], [0.1, 1.6, 2.0]);
        let gaze = f32s(&v["gaze"]);
        assert!(gaze[0].is_nan() && gaze[1] == 0.75);
        assert_eq!(unbase64(v["sampler"].as_str().unwrap()), [0, 0, 1]);
        assert_eq!(v["samplers"], json!(["midpoint 4", "single step"]));
        // Only the left foot, only in the first frame; the rig has no right one.
        assert_eq!(unbase64(v["touch"].as_str().unwrap()), [1, 0, 0]);
    }

    #[test]
    fn voices_are_halved_and_absent_ones_are_null() {
        let v = parsed(&recording(), &Meta::default());
        assert!(v["userVoice"].is_null());
        let voice = i16s(&v["agentVoice"]);
        assert_eq!(voice.len(), 1200);
        for (i, value) in voice.iter().enumerate().take(1180).skip(20) {
            let want = 0.5 * (2.0 * i as f32 * 0.05).sin();
            assert!((f32::from(*value) / 32767.0 - want).abs() < 2e-3, "{i}");
        }
    }

    #[test]
    fn halving_removes_what_the_lower_rate_cannot_hold() {
        // 10 kHz at 24 kHz would fold to 2 kHz.
        let high: Vec<f32> = (0..2400).map(|i| (i as f32 * std::f32::consts::TAU * 10.0 / 24.0).sin()).collect();
        assert!(halved(&high)[20..1180].iter().all(|x| x.abs() < 0.01));
        assert!(halved(&[]).is_empty());
    }

    #[test]
    fn text_cannot_break_out() {
        let meta = Meta {
            title: "</script><script>alert(1)</script><!-- \u{2028} \"quoted\" 안녕".into(),
            subtitle: "{{script}} <b>".into(),
            facts: vec![("a<b".into(), "\\".into())],
            method: Some("<i>".into()),
            live: None,
        };
        let text = json(&recording(), &meta);
        assert!(!text.contains('<'));
        let v: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(v["title"], meta.title);
        assert_eq!(v["subtitle"], meta.subtitle);
        assert_eq!(v["samplers"][0], "<i>");
        assert_eq!(v["facts"][0], json!(["a<b", "\\"]));
        let page = super::super::render(&recording(), &meta);
        assert_eq!(page.to_ascii_lowercase().matches("</script>").count(), 2);
        assert!(!page.contains("<title></script>"));
    }

    #[test]
    fn short_tracks_do_not_panic() {
        let mut r = recording();
        r.user.truncate(1);
        r.frames.iter_mut().for_each(|f| f.local.clear());
        assert_eq!(f32s(&parsed(&r, &Meta::default())["user"]).len(), 9);
        r.frames.clear();
        assert_eq!(parsed(&r, &Meta::default())["frames"], 0);
    }
}
