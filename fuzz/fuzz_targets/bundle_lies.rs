//! Bundles that lie: a sound safetensors header whose shapes, offsets, types and sizes contradict
//! each other or the data, or a sound container whose config or weights are wrong.
#![no_main]

use arbitrary::{Arbitrary, Unstructured};
use libfuzzer_sys::fuzz_target;
use safetensors::Dtype;
use std::sync::OnceLock;
use visavis::internals::bundle::CONFIG_KEY;
use visavis::{Engine, Sampler, SessionOptions};
use visavis_fuzz::kinds;

/// Numbers that break things.
const EDGES: [u64; 14] =
    [0, 1, 2, 3, 255, 1 << 15, 1 << 16, 1 << 31, (1 << 32) - 1, 1 << 32, (1 << 53) + 1, 1 << 62, 1 << 63, u64::MAX];

#[derive(Debug, Arbitrary)]
enum Lie {
    /// A number of the config, by its place among all of them.
    Config(u16, u8),
    /// A number of the config, close to what it was.
    Nudge(u16, i8),
    /// A tensor's shape in the header.
    Shape(u8, u8, u8),
    /// A tensor's offsets in the header.
    Offsets(u8, u8, u8),
    /// Two tensors on the same bytes.
    Overlap(u8, u8),
    /// A tensor's type in the header.
    Dtype(u8, u8),
    /// A tensor gone, or there under another name.
    Missing(u8),
    Renamed(u8),
    /// A weight: another number in place of the right one.
    Weight(u8, u16, f32),
    /// All weights of a tensor, far too large.
    Huge(u8),
    /// The header's length.
    Length(u8),
    /// The file cut.
    Cut(u16),
}

fuzz_target!(|data: &[u8]| {
    let mut u = Unstructured::new(data);
    // Half of them about the flow model, half about the featherweight tier.
    let kind = [0, 0, 1, 2][usize::from(u.arbitrary::<u8>().unwrap_or(0) % 4)];
    let Ok(lies) = Vec::<Lie>::arbitrary(&mut u) else { return };
    let bytes = tell(kind, &lies[..lies.len().min(4)]);
    let Ok(engine) = Engine::from_slice(&bytes, "fuzz") else { return };
    // One evaluation of one of the two networks, for every other input: most lies are found out
    // before, and loading is what they are for.
    let sampler = match data.len() % 4 {
        0 => Sampler::Single,
        1 => Sampler::euler(1).expect("one step"),
        _ => return,
    };
    let Ok(mut session) = engine.session(SessionOptions { sampler, ..Default::default() }) else { return };
    // Heard in the second block, where the lies have left the hearing in its place.
    let _ = session.push_sound(1, &[0.5; 3_200], 24_000, glam::Vec3::new(1.0, 1.5, 1.0));
    for _ in 0..2 {
        let frames = session.poll(session.next_due()).expect("guarded").expect("due");
        assert!(frames.iter().flat_map(|f| &f.global).all(|t| t.position.is_finite() && t.rotation.is_finite()));
    }
});

/// A sound bundle's header, without its metadata, and the data after it.
fn sound(kind: usize) -> &'static (Header, Vec<u8>) {
    static SOUND: [OnceLock<(Header, Vec<u8>)>; 3] = [const { OnceLock::new() }; 3];
    SOUND[kind].get_or_init(|| {
        let (mut header, mut data) = (Header::new(), Vec::new());
        for (name, (dtype, shape, bytes)) in &kinds()[kind].tensors {
            let offsets = [data.len(), data.len() + bytes.len()];
            data.extend_from_slice(bytes);
            let dtype = if *dtype == Dtype::F16 { "F16" } else { "F32" };
            header.insert(name.clone(), serde_json::json!({ "dtype": dtype, "shape": shape, "data_offsets": offsets }));
        }
        (header, data)
    })
}

type Header = serde_json::Map<String, serde_json::Value>;

fn edge(i: u8) -> u64 {
    EDGES[usize::from(i) % EDGES.len()]
}

/// Numbers of a JSON value, in order.
fn numbers<'a>(value: &'a mut serde_json::Value, out: &mut Vec<&'a mut serde_json::Value>) {
    match value {
        serde_json::Value::Number(_) => out.push(value),
        serde_json::Value::Array(list) => list.iter_mut().for_each(|v| numbers(v, out)),
        serde_json::Value::Object(map) => map.iter_mut().for_each(|(_, v)| numbers(v, out)),
        _ => {}
    }
}

fn tell(kind: usize, lies: &[Lie]) -> Vec<u8> {
    let names: Vec<_> = kinds()[kind].tensors.keys().collect();
    let name = |i: u8| names[usize::from(i) % names.len()].clone();
    let mut config = kinds()[kind].config.clone();
    let (mut header, mut data) = sound(kind).clone();
    let (mut length, mut cut) = (None, None);
    for lie in lies {
        match lie {
            Lie::Config(at, value) => {
                let mut all = Vec::new();
                numbers(&mut config, &mut all);
                let n = all.len();
                *all[usize::from(*at) % n] = edge(*value).into();
            }
            Lie::Nudge(at, by) => {
                let mut all = Vec::new();
                numbers(&mut config, &mut all);
                let n = all.len();
                let value = &mut *all[usize::from(*at) % n];
                let next = match value.as_i64() {
                    Some(v) => v.saturating_add(i64::from(*by)).into(),
                    None => (value.as_f64().unwrap_or(0.0) * f64::from(*by)).into(),
                };
                *value = next;
            }
            Lie::Shape(tensor, axis, value) => {
                if let Some(shape) = header.get_mut(&name(*tensor)).and_then(|t| t["shape"].as_array_mut()) {
                    let n = shape.len().max(1);
                    match shape.get_mut(usize::from(*axis) % n) {
                        Some(size) if axis % 4 != 3 => *size = edge(*value).into(),
                        _ => shape.push(edge(*value).into()),
                    }
                }
            }
            Lie::Offsets(tensor, end, value) => {
                if let Some(tensor) = header.get_mut(&name(*tensor)) {
                    tensor["data_offsets"][usize::from(*end) % 2] = edge(*value).into();
                }
            }
            Lie::Overlap(a, b) => {
                let offsets = header.get(&name(*a)).map(|t| t["data_offsets"].clone());
                if let (Some(offsets), Some(tensor)) = (offsets, header.get_mut(&name(*b))) {
                    tensor["data_offsets"] = offsets;
                }
            }
            Lie::Dtype(tensor, dtype) => {
                let types = ["F64", "I64", "BF16", "I8", "U8", "BOOL", "F8_E4M3", "nothing", "F16", "F32"];
                if let Some(tensor) = header.get_mut(&name(*tensor)) {
                    tensor["dtype"] = types[usize::from(*dtype) % types.len()].into();
                }
            }
            Lie::Missing(tensor) => drop(header.remove(&name(*tensor))),
            Lie::Renamed(tensor) => {
                if let Some(value) = header.remove(&name(*tensor)) {
                    header.insert(format!("{}x", name(*tensor)), value);
                }
            }
            Lie::Weight(tensor, at, value) => {
                let range = range(&header, &name(*tensor));
                if let Some(place) = range.and_then(|r| data.get_mut(r)).filter(|p| p.len() >= 4) {
                    let at = usize::from(*at) % (place.len() / 4) * 4;
                    place[at..at + 4].copy_from_slice(&value.to_le_bytes());
                }
            }
            Lie::Huge(tensor) => {
                if let Some(place) = range(&header, &name(*tensor)).and_then(|r| data.get_mut(r)) {
                    place.chunks_exact_mut(4).for_each(|p| p.copy_from_slice(&3e38f32.to_le_bytes()));
                }
            }
            Lie::Length(value) => length = Some(edge(*value)),
            Lie::Cut(at) => cut = Some(usize::from(*at) * 8),
        }
    }
    header.insert("__metadata__".to_owned(), serde_json::json!({ CONFIG_KEY: config.to_string() }));
    let text = serde_json::Value::Object(header).to_string();
    let mut bytes = length.unwrap_or(text.len() as u64).to_le_bytes().to_vec();
    bytes.extend_from_slice(text.as_bytes());
    bytes.extend_from_slice(&data);
    if let Some(cut) = cut {
        bytes.truncate(cut);
    }
    bytes
}

fn range(header: &Header, name: &str) -> Option<std::ops::Range<usize>> {
    let offsets = &header.get(name)?["data_offsets"];
    let (from, to) = (offsets[0].as_u64()? as usize, offsets[1].as_u64()? as usize);
    (from <= to).then_some(from..to)
}
