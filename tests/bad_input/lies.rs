//! Bundles whose header or config lies: sound JSON with sizes, shapes, offsets and types that
//! contradict each other or the file. Each is a typed error, found before memory is taken.

use super::bundle::{NAME, Parts, tiny_bytes};
use proptest::prelude::*;
use serde_json::{Map, Value, json};
use visavis::{Engine, ErrorKind, SessionOptions};

/// Numbers that break things.
const EDGES: [u64; 12] =
    [0, 1, 2, 255, 1 << 16, 1 << 31, (1 << 32) - 1, 1 << 32, (1 << 53) + 1, 1 << 62, 1 << 63, u64::MAX];

/// The header of the tiny bundle and the data behind it.
fn taken_apart() -> (Map<String, Value>, Vec<u8>) {
    let bytes = tiny_bytes();
    let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let Value::Object(map) = serde_json::from_slice(&bytes[8..header]).unwrap() else { unreachable!("an object") };
    (map, bytes[header..].to_vec())
}

fn put_together(header: Map<String, Value>, data: &[u8]) -> Vec<u8> {
    let text = Value::Object(header).to_string();
    [&(text.len() as u64).to_le_bytes(), text.as_bytes(), data].concat()
}

/// Loads `bytes`; what loads must run, what does not must say so in kind.
fn judged(bytes: Vec<u8>) -> Option<ErrorKind> {
    match Engine::from_bytes(bytes, NAME) {
        Err(e) => {
            let kinds = [ErrorKind::BundleCorrupt, ErrorKind::BundleInvalid, ErrorKind::BundleVersion];
            assert!(kinds.contains(&e.kind()) && e.to_string().starts_with(NAME), "{e}");
            Some(e.kind())
        }
        Ok(engine) => {
            let mut session = engine.session(SessionOptions::default()).expect("a session");
            for _ in 0..3 {
                let frames = session.poll(session.next_due()).expect("guarded").expect("due");
                assert!(
                    frames.iter().flat_map(|f| &f.global).all(|t| t.position.is_finite() && t.rotation.is_finite())
                );
            }
            None
        }
    }
}

/// Places of all numbers of a JSON value.
fn numbers(value: &Value, at: &str, out: &mut Vec<String>) {
    match value {
        Value::Number(_) => out.push(at.to_owned()),
        Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| numbers(v, &format!("{at}/{i}"), out)),
        Value::Object(map) => map.iter().for_each(|(k, v)| numbers(v, &format!("{at}/{k}"), out)),
        _ => {}
    }
}

#[test]
fn every_number_of_the_config_may_be_anything() {
    let config = Parts::tiny().config;
    let mut places = Vec::new();
    numbers(&config, "", &mut places);
    assert!(places.len() > 80, "{} numbers", places.len());
    let (mut refused, mut taken) = (0, 0);
    for place in &places {
        for value in [json!(0), json!(-1), json!(1u64 << 31), json!(u64::MAX), json!(1e300), json!(0.5)] {
            let mut parts = Parts::tiny();
            *parts.config.pointer_mut(place).unwrap() = value;
            match judged(parts.bytes()) {
                Some(_) => refused += 1,
                None => taken += 1,
            }
        }
    }
    println!("{refused} configs refused, {taken} usable");
    assert!(refused > taken);
}

/// Sizes that the file does not pay for: little weights, much cache.
#[test]
fn what_a_session_would_take_is_bounded() {
    let refused = |change: fn(&mut Value)| {
        let mut parts = Parts::tiny();
        change(&mut parts.config);
        let e = Engine::from_bytes(parts.bytes(), NAME).expect_err("must be refused");
        assert_eq!(e.kind(), ErrorKind::BundleInvalid);
        e.to_string()
    };
    let message = refused(|c| {
        c["flow"]["layers"] = 64.into();
        c["flow"]["window_blocks"] = 1024.into();
        c["flow"]["width"] = 1024.into();
    });
    assert!(message.contains("MiB"), "{message}");
    let message = refused(|c| {
        c["vae"]["layers"] = 64.into();
        c["vae"]["window_blocks"] = 1024.into();
        c["vae"]["width"] = 384.into();
    });
    assert!(message.contains("MiB"), "{message}");
}

#[test]
fn headers_that_lie_are_refused() {
    let (header, data) = taken_apart();
    let names: Vec<_> = header.keys().filter(|k| *k != "__metadata__").cloned().collect();
    let lie = |change: &dyn Fn(&mut Map<String, Value>)| {
        let mut header = header.clone();
        change(&mut header);
        judged(put_together(header, &data))
    };
    let name = &names[names.len() / 2];
    for edge in EDGES {
        for end in 0..2 {
            let kind = lie(&|h| h[name]["data_offsets"][end] = edge.into());
            assert_eq!(kind, Some(ErrorKind::BundleCorrupt), "offset {edge}");
        }
        let kind = lie(&|h| h[name]["shape"][0] = edge.into());
        assert!(kind.is_some(), "shape {edge}");
        let kind = lie(&|h| h[name]["shape"].as_array_mut().unwrap().extend([edge.into(), edge.into()]));
        assert!(kind.is_some() || edge == 1, "two more axes of {edge}");
    }
    let other = header[&names[0]]["data_offsets"].clone();
    assert!(lie(&|h| h[name]["data_offsets"] = other.clone()).is_some(), "two tensors on the same bytes");
    for dtype in ["F64", "I64", "BOOL", "F8_E4M3", "nothing"] {
        assert!(lie(&|h| h[name]["dtype"] = dtype.into()).is_some(), "{dtype}");
    }
    let mut bytes = put_together(header.clone(), &data);
    for length in EDGES {
        bytes[..8].copy_from_slice(&length.to_le_bytes());
        assert_eq!(judged(bytes.clone()), Some(ErrorKind::BundleCorrupt), "header of {length} bytes");
    }
}

/// Weights that are finite and far too large: the bundle is sound, what it makes is not, and the
/// guard holds a pose.
#[test]
fn weights_that_overflow_are_held() {
    for name in ["flow.final.out.weight", "student.final.out.weight", "vae.decoder.out.weight"] {
        let mut parts = Parts::tiny();
        let shape = parts.tensors[name].1.clone();
        parts.f32(name, &shape, 3e38);
        let engine = Engine::from_bytes(parts.bytes(), NAME).expect("finite weights load");
        let mut session = engine.session(SessionOptions::default()).unwrap();
        let student = visavis::Sampler::Single;
        for sampler in [visavis::Sampler::Midpoint4, student] {
            session.set_sampler(sampler).unwrap();
            let broken = name.starts_with("vae") || (name.starts_with("student") == (sampler == student));
            let mut held = 0;
            for _ in 0..12 {
                let frames = session.poll(session.next_due()).unwrap().unwrap();
                assert!(
                    frames.iter().flat_map(|f| &f.global).all(|t| t.position.is_finite() && t.rotation.is_finite())
                );
                held += frames.iter().filter(|f| f.held == 1.0).count();
            }
            assert!(!broken || held > 40, "{name}, {sampler}: {held} of 48 frames held");
        }
        let stats = session.stats().guard;
        assert!(stats.trips > 0 && stats.held_frames > 40, "{name}: {stats:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    /// Several lies at once.
    #[test]
    fn lies_in_any_company(lies in prop::collection::vec((any::<u16>(), 0usize..6, 0usize..EDGES.len()), 1..4)) {
        let (mut header, data) = taken_apart();
        let names: Vec<_> = header.keys().filter(|k| *k != "__metadata__").cloned().collect();
        for (which, what, edge) in lies {
            let name = &names[usize::from(which) % names.len()];
            let edge = Value::from(EDGES[edge]);
            let Some(tensor) = header.get_mut(name) else { continue };
            match what {
                0 => tensor["shape"][0] = edge,
                1 => tensor["shape"] = json!([edge, edge]),
                2 => tensor["data_offsets"][0] = edge,
                3 => tensor["data_offsets"][1] = edge,
                4 => tensor["dtype"] = "I8".into(),
                _ => drop(header.remove(name)),
            }
        }
        judged(put_together(header, &data));
    }
}
