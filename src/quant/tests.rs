use super::*;
use crate::bundle::StoredData;
use crate::kernels::I4_GROUP;

/// Reproducible values with a few large ones, as weights have.
fn weights(n: usize) -> Vec<f32> {
    let mut state = 12345u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 24) as f32 - 0.5
    };
    (0..n).map(|_| 0.2 * (unit() + unit() + unit()) + if unit() > 0.48 { unit() } else { 0.0 }).collect()
}

#[test]
fn rounding_loses_what_the_scheme_costs() {
    for cols in [1, 31, 32, 33, 100] {
        let w = weights(7 * cols);
        for (scheme, least) in
            [(Scheme::F32, f64::INFINITY), (Scheme::F16, 60.0), (Scheme::I8, 34.0), (Scheme::I4, 14.0)]
        {
            let stored = round(&w, 7, cols, scheme).unwrap();
            assert!(stored.scheme() == scheme && stored.borrow().is_complete());
            let db = sqnr_db(&w, &stored.to_f32());
            assert!(db >= least, "{scheme} of 7 x {cols}: {db} dB");
        }
    }
}

#[test]
fn a_searched_scale_is_no_worse_than_the_largest_weight() {
    let w = weights(64 * 96);
    let plain = |group: usize, low: f32, high: f32| -> Vec<f32> {
        let rounded = w.chunks(group).flat_map(|row| {
            let s = row.iter().fold(0.0f32, |m, v| m.max(v.abs())) / high;
            row.iter().map(move |v| s * (v / s).round_ties_even().clamp(low, high))
        });
        rounded.collect()
    };
    let of = |scheme| round(&w, 64, 96, scheme).unwrap().to_f32();
    assert!(sqnr_db(&w, &of(Scheme::I8)) >= sqnr_db(&w, &plain(96, -127.0, 127.0)));
    let gain = sqnr_db(&w, &of(Scheme::I4)) - sqnr_db(&w, &plain(I4_GROUP, -8.0, 7.0));
    assert!(gain > 0.5, "{gain} dB");
}

#[test]
fn rows_of_nothing_stay_nothing() {
    for value in [0.0, 1e-38, -1e-44] {
        let w = [vec![value; 40], vec![0.5; 40]].concat();
        for scheme in [Scheme::I8, Scheme::I4] {
            let back = round(&w, 2, 40, scheme).unwrap().to_f32();
            assert!(back[..40].iter().all(|v| *v == 0.0), "{scheme}: {:?}", &back[..2]);
            assert!(back[40..].iter().all(|v| (v - 0.5).abs() < 0.01), "{scheme}");
        }
    }
}

#[test]
fn numbers_beyond_f16_are_refused() {
    for scheme in [Scheme::F16, Scheme::I4] {
        let e = round(&[1e6; 32], 1, 32, scheme).unwrap_err();
        assert!(e.kind() == ErrorKind::Argument && e.to_string().contains("=f32"), "{e}");
    }
    let StoredData::I8 { scale, .. } = round(&[1e6; 32], 1, 32, Scheme::I8).unwrap().data else { panic!("int8") };
    assert!((scale[0] - 1e6 / 127.0).abs() < 1.0);
}

#[test]
fn patterns_name_layers() {
    let fits = |pattern: &str, name: &str| pattern.parse::<Keep>().unwrap().fits(name);
    for pattern in
        ["*", "flow.*", "*.qkv", "flow.layers.0.qkv", "flow.layers.0.qkv.weight", "fl*.0.*v", "*=f32", "f*=f16"]
    {
        assert!(fits(pattern, "flow.layers.0.qkv"), "{pattern}");
    }
    for pattern in ["flow", "*.fc1", "low.*", "flow.layers.1.*", "*qkv*v"] {
        assert!(!fits(pattern, "flow.layers.0.qkv"), "{pattern}");
    }
    for bad in ["", "=f16", "flow.*=i8", "flow.*="] {
        assert!(bad.parse::<Keep>().is_err(), "{bad}");
    }
    // Many stars do not make matching slow.
    assert!(!fits(&"*a".repeat(40), &"a".repeat(39)));
}

/// Inputs that go together: what one weight loses the others can make up for.
#[test]
fn nearest_plane_beats_nearest_on_correlated_inputs() {
    let (rows, cols, n) = (24, 70, 400);
    let (w, noise) = (weights(rows * cols), weights(n * cols));
    let x: Vec<f32> = (0..n * cols).map(|i| noise[i / cols * cols + (i % cols) / 8] + 0.2 * noise[i]).collect();
    let mut moments = vec![0.0f64; cols * cols];
    for x in x.chunks_exact(cols) {
        for i in 0..cols {
            (i..cols).for_each(|j| moments[i * cols + j] += f64::from(x[i]) * f64::from(x[j]));
        }
    }
    let r = nearest_plane::factor(&moments, cols).unwrap();
    let outputs = |w: &[f32]| -> Vec<f32> {
        let dot = |x: &[f32], w: &[f32]| x.iter().zip(w).map(|(a, b)| a * b).sum::<f32>();
        x.chunks_exact(cols).flat_map(|x| w.chunks_exact(cols).map(move |w| dot(x, w))).collect()
    };
    let exact = outputs(&w);
    for scheme in [Scheme::I8, Scheme::I4] {
        let plain = round(&w, rows, cols, scheme).unwrap();
        let planes = nearest_plane::round_for(&w, rows, cols, scheme, &r).unwrap();
        assert!(planes.borrow().is_complete() && planes.scheme() == scheme);
        let db = |w: &StoredWeights| sqnr_db(&exact, &outputs(&w.to_f32()));
        assert!(db(&planes) > db(&plain) + 3.0, "{scheme}: {} dB after {} dB", db(&planes), db(&plain));
    }
    assert_eq!(nearest_plane::factor(&[0.0; 4], 2), None, "a layer that nothing runs through");
}

#[test]
fn whole_clip_bundles_are_quantised_and_run() {
    let bundle = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/goldens/mospa.safetensors");
    let file = BundleFile::open(bundle).unwrap();
    let options = Options { scheme: Scheme::I8, smallest: 0, keep: &[], calibration: None, budget: None };
    let quantised = quantise(&file, &options).unwrap();
    assert!(quantised.schemes.values().all(|scheme| *scheme == Scheme::I8));
    let small = BundleFile::from_bytes(quantised.bytes, "small");
    let kernels = Kernels::detect().unwrap();
    let [a, b] = [&file, &small].map(|file| {
        let reactor = Reactor::load(file, kernels).unwrap();
        let ear = vec![0.3; reactor.frames() * 132];
        let heard = crate::mospa::Heard { left: &ear, right: &ear, place: Some([1.0, 1.0, 2.0]), genre: Some(1) };
        reactor.clean(&heard, &reactor.noise(1), 999).unwrap()
    });
    let square = |x: &mut dyn Iterator<Item = f32>| x.map(|v| v * v).sum::<f32>();
    let off = square(&mut a.iter().zip(&b).map(|(a, b)| a - b)) / square(&mut a.iter().copied());
    assert!(off > 0.0 && off < 0.01, "{off}");
}
