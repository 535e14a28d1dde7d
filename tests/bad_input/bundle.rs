//! Damaged, foreign and inconsistent bundles.

use super::common::golden_path;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::collections::{BTreeMap, HashMap};
use visavis::internals::bundle::CONFIG_KEY;
use visavis::{BundleFile, Engine, Error, ErrorKind, SessionOptions};

pub(super) const NAME: &str = "some/bundle.safetensors";

pub(super) fn tiny_bytes() -> Vec<u8> {
    std::fs::read(golden_path("tiny.safetensors")).expect("the tiny bundle")
}

/// A bundle taken apart, to be changed and put together again.
pub(super) struct Parts {
    pub(super) config: serde_json::Value,
    pub(super) tensors: BTreeMap<String, (Dtype, Vec<usize>, Vec<u8>)>,
}

impl Parts {
    pub(super) fn tiny() -> Self {
        Self::of(&tiny_bytes())
    }

    fn dram(backbone: &str) -> Self {
        Self::of(&std::fs::read(golden_path(&format!("dram-{backbone}.safetensors"))).expect("the tiny bundle"))
    }

    fn of(bytes: &[u8]) -> Self {
        let (_, header) = SafeTensors::read_metadata(bytes).unwrap();
        let config = serde_json::from_str(&header.metadata().as_ref().unwrap()[CONFIG_KEY]).unwrap();
        let file = SafeTensors::deserialize(bytes).unwrap();
        let tensors = file.iter().map(|(n, v)| (n.to_owned(), (v.dtype(), v.shape().to_vec(), v.data().to_vec())));
        Self { config, tensors: tensors.collect() }
    }

    pub(super) fn bytes(&self) -> Vec<u8> {
        self.bytes_with(Some(self.config.to_string()))
    }

    fn bytes_with(&self, config: Option<String>) -> Vec<u8> {
        let views = self.tensors.iter().map(|(n, (dtype, shape, data))| {
            (n.as_str(), TensorView::new(*dtype, shape.clone(), data).expect("a sound tensor"))
        });
        let metadata = config.map(|c| HashMap::from([(CONFIG_KEY.to_owned(), c)]));
        safetensors::serialize(views, metadata).unwrap()
    }

    pub(super) fn f32(&mut self, name: &str, shape: &[usize], value: f32) {
        let data = value.to_le_bytes().repeat(shape.iter().product());
        self.tensors.insert(name.to_owned(), (Dtype::F32, shape.to_vec(), data));
    }
}

/// The error that loading `bytes` ends with; it names the file.
fn refused(bytes: Vec<u8>) -> Error {
    let e = Engine::from_bytes(bytes, NAME).expect_err("must be refused");
    assert!(e.to_string().starts_with(NAME), "{e}");
    e
}

/// Changes the tiny bundle, and expects an error of `kind` that contains `part`.
fn changed(kind: ErrorKind, part: &str, change: impl FnOnce(&mut Parts)) {
    let mut parts = Parts::tiny();
    change(&mut parts);
    let e = refused(parts.bytes());
    assert_eq!(e.kind(), kind, "{e}");
    assert!(e.to_string().contains(part), "expected `{part}`: {e}");
}

#[test]
fn the_parts_put_together_again_load() {
    Engine::from_bytes(Parts::tiny().bytes(), NAME).unwrap();
}

#[test]
fn missing_and_empty_files_are_named() {
    let e = Engine::load("no/such/bundle.safetensors").unwrap_err();
    assert_eq!(e.kind(), ErrorKind::Io);
    assert!(e.to_string().starts_with("no/such/bundle.safetensors: "), "{e}");
    assert_eq!(refused(Vec::new()).kind(), ErrorKind::BundleCorrupt);
    assert_eq!(Engine::load("src").unwrap_err().kind(), ErrorKind::Io, "a folder");
}

#[test]
fn a_bundle_cut_anywhere_is_corrupt() {
    let bytes = tiny_bytes();
    let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let around = (0..20).chain(header - 20..header + 20).chain(bytes.len() - 20..bytes.len());
    for len in around.chain((0..bytes.len()).step_by(1999)) {
        let e = refused(bytes[..len].to_vec());
        assert_eq!(e.kind(), ErrorKind::BundleCorrupt, "{len}: {e}");
    }
    let longer = [bytes, vec![0; 100]].concat();
    assert_eq!(refused(longer).kind(), ErrorKind::BundleCorrupt);
}

#[test]
fn other_files_are_no_bundles() {
    for bytes in [&b"RIFF\x24\0\0\0WAVEfmt something"[..], b"{}", &[0xff; 4096], &[0; 4096]] {
        assert_eq!(refused(bytes.to_vec()).kind(), ErrorKind::BundleCorrupt);
    }
    let parts = Parts::tiny();
    let e = refused(parts.bytes_with(None));
    assert!(e.kind() == ErrorKind::BundleInvalid && e.to_string().contains("not a Visavis bundle"), "{e}");
    for config in ["", "{", "[]", "{\"format\":1}", "{\"format\":\"1\"}"] {
        assert_eq!(refused(parts.bytes_with(Some(config.to_owned()))).kind(), ErrorKind::BundleInvalid, "{config}");
    }
}

/// What loads in spite of a flipped bit must still be usable: only finite numbers come out of it.
fn load_flipped(mut bytes: Vec<u8>, at: usize, bit: u32) -> bool {
    bytes[at] ^= 1 << bit;
    let engine = match Engine::from_bytes(bytes, NAME) {
        Ok(engine) => engine,
        Err(e) => {
            let kinds = [ErrorKind::BundleCorrupt, ErrorKind::BundleInvalid, ErrorKind::BundleVersion];
            assert!(kinds.contains(&e.kind()) && e.to_string().starts_with(NAME), "byte {at}, bit {bit}: {e}");
            return false;
        }
    };
    let mut session = engine.session(SessionOptions::default()).unwrap();
    session.push_agent_audio(&[0.25; 6400], 24_000).unwrap();
    for _ in 0..2 {
        let frames = session.poll(session.next_due()).unwrap().unwrap();
        for joint in frames.iter().flat_map(|f| &f.global) {
            assert!(joint.position.is_finite() && joint.rotation.is_finite(), "byte {at}, bit {bit}");
        }
    }
    true
}

#[test]
fn a_flipped_bit_in_the_header_is_an_error_or_harmless() {
    let bytes = tiny_bytes();
    let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let flips = (0..64).map(|i| (i / 8, i % 8)).chain((8..header).step_by(41).map(|at| (at, at % 8)));
    let loaded = flips.map(|(at, bit)| u32::from(load_flipped(bytes.clone(), at, bit as u32))).sum::<u32>();
    println!("{loaded} headers were still sound");
}

#[test]
fn a_flipped_bit_in_the_data_is_an_error_or_harmless() {
    let bytes = tiny_bytes();
    let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let flips: Vec<_> = (header..bytes.len()).step_by(997).map(|at| (at | 1, (at / 997 % 8) as u32)).collect();
    let loaded = flips.iter().filter(|(at, bit)| load_flipped(bytes.clone(), (*at).min(bytes.len() - 1), *bit)).count();
    println!("{loaded} of {} were still sound", flips.len());
    assert!(loaded > 0, "most flips change a weight a little");
}

#[test]
fn other_versions_say_what_to_do() {
    changed(ErrorKind::BundleVersion, "update visavis", |p| p.config["format"] = 2.into());
    changed(ErrorKind::BundleVersion, "export the bundle again", |p| p.config["format"] = 0.into());
}

#[test]
fn config_and_tensors_must_agree() {
    let invalid = ErrorKind::BundleInvalid;
    changed(invalid, "flow.input.weight is missing", |p| drop(p.tensors.remove("flow.input.weight")));
    changed(invalid, "tensor student.", |p| p.tensors.retain(|name, _| !name.starts_with("student.")));
    changed(invalid, "not part of the network", |p| p.f32("flow.layers.9.qkv.weight", &[2, 2], 0.5));
    changed(invalid, "not part of the network", |p| p.config["student"] = serde_json::Value::Null);
    changed(invalid, "vae.encoder.ln_f.bias has shape", |p| p.f32("vae.encoder.ln_f.bias", &[7], 0.5));
    changed(invalid, "has shape", |p| p.config["flow"]["width"] = 64.into());
    changed(invalid, "vae.decoder.out.bias is I8", |p| {
        let (_, shape, _) = p.tensors["vae.decoder.out.bias"].clone();
        let data = vec![1; shape.iter().product()];
        p.tensors.insert("vae.decoder.out.bias".to_owned(), (Dtype::I8, shape, data));
    });
    changed(invalid, "idle.frames", |p| {
        let (dtype, shape, data) = p.tensors["idle.frames"].clone();
        let row = data.len() / shape[0];
        p.tensors.insert("idle.frames".to_owned(), (dtype, vec![shape[0] - 1, shape[1]], data[row..].to_vec()));
    });
    changed(invalid, "stats.pose_std", |p| {
        let shape = p.tensors["stats.pose_std"].1.clone();
        p.f32("stats.pose_std", &shape, 0.0);
    });
}

#[test]
fn sizes_out_of_range_are_refused_before_memory_is_taken() {
    let invalid = ErrorKind::BundleInvalid;
    changed(invalid, "flow.width", |p| p.config["flow"]["width"] = 1_000_000_000_u64.into());
    changed(invalid, "flow.heads", |p| p.config["flow"]["heads"] = 0.into());
    changed(invalid, "vae.window_blocks", |p| p.config["vae"]["window_blocks"] = u32::MAX.into());
    changed(invalid, "user_delay_blocks", |p| p.config["user_delay_blocks"] = 0.into());
    changed(invalid, "strides", |p| p.config["audio"]["layers"][0]["stride"] = 4.into());
    changed(invalid, "parents come before", |p| p.config["rig"]["joints"][3]["parent"] = 7.into());
    changed(invalid, "cannot be read", |p| p.config["flow"]["width"] = (-1).into());
    changed(invalid, "cannot be read", |p| drop(p.config.as_object_mut().unwrap().remove("vae")));
}

#[test]
fn weights_that_are_not_finite_are_corrupt() {
    let names: Vec<_> = Parts::tiny().tensors.into_keys().collect();
    for value in [f32::NAN, f32::INFINITY] {
        for name in names.iter().step_by(7) {
            changed(ErrorKind::BundleCorrupt, name, |p| {
                let shape = p.tensors[name].1.clone();
                p.f32(name, &shape, value);
            });
        }
    }
}

/// A bundle as an asset inside another file, at an offset that is neither of a page nor of a
/// number.
#[test]
fn a_bundle_inside_another_file() {
    let (bytes, offset) = (tiny_bytes(), 4_097);
    let mut outer = vec![0xAA; offset];
    outer.extend_from_slice(&bytes);
    outer.extend_from_slice(&[0xBB; 100]);
    let path = std::env::temp_dir().join(format!("visavis-outer-{}", std::process::id()));
    std::fs::write(&path, &outer).unwrap();
    let file = std::fs::File::open(&path).unwrap();
    let open = |offset, length| BundleFile::open_part(&file, offset, length, NAME);
    let kind = |offset, length: u64| match open(offset, Some(length)) {
        Ok(part) => part.parse().map(|_| ()).expect_err("must be refused").kind(),
        Err(e) => e.kind(),
    };
    let (offset, length) = (offset as u64, bytes.len() as u64);
    let whole = open(offset, Some(length)).unwrap();
    let engine = Engine::from_file(&whole, visavis::internals::kernels::Kernels::detect().unwrap()).unwrap();
    assert_eq!(engine.config(), Engine::from_slice(&bytes, NAME).unwrap().config());
    assert_eq!(kind(offset, length + 101), ErrorKind::Argument);
    assert_eq!(kind(u64::MAX, 2), ErrorKind::Argument);
    assert_eq!(kind(offset, 0), ErrorKind::BundleCorrupt);
    assert_eq!(kind(offset + 1, length), ErrorKind::BundleCorrupt);
    assert_eq!(kind(offset, length - 1), ErrorKind::BundleCorrupt);
    std::fs::remove_file(&path).unwrap();
}

/// The kind `dram`: ranges, shapes, what is missing or too much, and numbers that are none.
#[test]
fn featherweight_bundles_are_checked_as_strictly() {
    let refuse = |backbone: &str, kind: ErrorKind, part: &str, change: &dyn Fn(&mut Parts)| {
        let mut parts = Parts::dram(backbone);
        change(&mut parts);
        let e = refused(parts.bytes());
        assert!(e.kind() == kind && e.to_string().contains(part), "{backbone}: expected `{part}`: {e}");
    };
    let set = |path: &'static str, value: serde_json::Value| {
        move |parts: &mut Parts| *parts.config.pointer_mut(path).expect("it is there") = value.clone()
    };
    use ErrorKind::{BundleCorrupt, BundleInvalid};
    for backbone in ["tcn", "lstm"] {
        Engine::from_bytes(Parts::dram(backbone).bytes(), NAME).unwrap();
        for (kind, part, path, value) in [
            (BundleInvalid, "unknown variant `rnn`", "/kind", "rnn".into()),
            (BundleInvalid, "missing field `mospa`", "/kind", "mospa".into()),
            (BundleInvalid, "missing field", "/kind", "sarah".into()),
            (BundleInvalid, "monadic.width is 0", "/dram/monadic/width", 0.into()),
            (BundleInvalid, "dyadic.width is 70000", "/dram/dyadic/width", 70_000.into()),
            (BundleInvalid, "has shape", "/dram/dyadic/width", 7.into()),
            (BundleInvalid, "unknown variant", "/dram/backbone", "gru".into()),
            (BundleInvalid, "user_delay_blocks is 2", "/user_delay_blocks", 2.into()),
            (BundleInvalid, "agent_delay_blocks is 1", "/agent_delay_blocks", 1.into()),
            (BundleInvalid, "session.bridge is -1", "/session/bridge", (-1).into()),
        ] {
            refuse(backbone, kind, part, &set(path, value));
        }
        refuse(backbone, BundleInvalid, "invalid type", &set("/dram", serde_json::json!("no")));
        refuse(backbone, BundleInvalid, "missing field `dram`", &|parts| {
            parts.config.as_object_mut().unwrap().remove("dram");
        });
        for name in ["stats.step_std", "idle.frames", "monadic.into.weight", "dyadic.out.bias"] {
            refuse(backbone, BundleInvalid, &format!("tensor {name} is missing"), &|parts| {
                parts.tensors.remove(name);
            });
            refuse(backbone, BundleCorrupt, &format!("tensor {name} holds NaN"), &|parts| {
                let (dtype, _, data) = parts.tensors.get_mut(name).unwrap();
                let nan = if *dtype == Dtype::F16 { vec![0x00, 0x7e] } else { f32::NAN.to_le_bytes().to_vec() };
                data[..nan.len()].copy_from_slice(&nan);
            });
        }
        refuse(backbone, BundleInvalid, "deviations are positive", &|parts| parts.f32("stats.step_std", &[136], 0.0));
        refuse(backbone, BundleInvalid, "idle.frames has 1 frames", &|parts| parts.f32("idle.frames", &[1, 136], 0.1));
        refuse(backbone, BundleInvalid, "more the first", &|parts| parts.f32("more", &[2], 0.0));
    }
    refuse("tcn", BundleInvalid, "dilations is 0", &set("/dram/monadic/dilations", serde_json::json!([1, 0, 4])));
    refuse("tcn", BundleInvalid, "dilations is 5000", &set("/dram/monadic/dilations", serde_json::json!([1, 2, 5000])));
    refuse("tcn", BundleInvalid, "unknown field", &|parts| parts.config["dram"]["monadic"]["layers"] = 3.into());
    refuse("lstm", BundleInvalid, "layers is 99", &set("/dram/dyadic/layers", 99.into()));
    changed(BundleInvalid, "its networks are not", |parts| {
        parts.config["dram"] = Parts::dram("tcn").config["dram"].clone()
    });
}

/// Predictors whose numbers run away: the guard answers, and what comes out stays finite.
#[test]
fn featherweight_weights_that_overflow_are_guarded() {
    for backbone in ["tcn", "lstm"] {
        let mut parts = Parts::dram(backbone);
        parts.f32("stats.step_std", &[136], 1e30);
        let engine = Engine::from_bytes(parts.bytes(), NAME).unwrap();
        let mut session = engine.session(SessionOptions::default()).unwrap();
        for _ in 0..20 {
            let frames = session.poll(session.next_due()).unwrap().unwrap();
            for frame in frames {
                assert!(frame.global.iter().all(|t| t.position.is_finite() && t.rotation.is_finite()));
                assert!(frame.dyadic.iter().all(|share| (0.0..=1.0).contains(share)));
            }
        }
        assert!(session.stats().guard.trips > 0);
        let unguarded = SessionOptions { guard: false, stance: false, ..Default::default() };
        let mut session = engine.session(unguarded).unwrap();
        let outcomes = (0..20).map(|_| session.poll(session.next_due()).map(drop).map_err(|e| e.kind()));
        assert!(outcomes.into_iter().all(|o| o.is_ok() || o == Err(ErrorKind::State)));
    }
}
