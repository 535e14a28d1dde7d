//! The same motion on every machine: digests of all bits of all frames, compared with
//! `tests/goldens/digests.txt`.
//!
//! Whatever changes the numbers on purpose (pose stage, stance, samplers, guidance, anchoring, the
//! tiny bundle) changes the digests: run `VISAVIS_DIGESTS=write cargo test --test machines` and
//! commit the file. A difference between two machines is a fault: sums must have a fixed order, and
//! functions such as sine must come from `libm`, not from the platform.

mod common;

use common::{Inputs, block_seconds, golden_path, run};
use std::fmt::Write;
use visavis::internals::audio::resample_to_24k;
use visavis::internals::kernels::{Kernels, KvDtype};
use visavis::internals::session::{Anchoring, Diagnostics};
use visavis::{BundleFile, Engine, Frame, Sampler, SessionOptions};

const BLOCKS: usize = 24;
const TINY: &str = "tiny.safetensors";
const DRAM: [(&str, &str); 2] = [("tcn", "dram-tcn.safetensors"), ("lstm", "dram-lstm.safetensors")];

/// FNV-1a, 64 bits.
struct Digest(u64);

impl Digest {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn add(&mut self, bytes: &[u8]) {
        for b in bytes {
            self.0 = (self.0 ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn floats(&mut self, values: &[f32]) {
        values.iter().for_each(|v| self.add(&v.to_bits().to_le_bytes()));
    }

    fn frame(&mut self, f: &Frame) {
        self.add(&f.index.to_le_bytes());
        [f.time, f.root.x, f.root.z, f.root.yaw].iter().for_each(|v| self.add(&v.to_bits().to_le_bytes()));
        for t in &f.global {
            self.floats(&t.position.to_array());
            self.floats(&t.rotation.to_array());
        }
        self.floats(&f.hips.to_array());
        f.local.iter().for_each(|q| self.floats(&q.to_array()));
        self.floats(&[f.fit_error, f.gaze.unwrap_or(f32::MAX)]);
        self.floats(&f.dyadic);
    }
}

/// Name, rate of the voices, options.
fn cases() -> Vec<(&'static str, u32, SessionOptions)> {
    let base = || SessionOptions { diagnostics: Anchoring::Every(6).into(), ..Default::default() };
    let gaze = |g| SessionOptions { gaze: Some(g), ..base() };
    let sampler = |sampler| SessionOptions { sampler, ..gaze(0.8) };
    let wide = Diagnostics { cache: KvDtype::F32, ..Anchoring::Every(6).into() };
    vec![
        ("free gaze, 24 kHz", 24_000, base()),
        ("gaze 0.8, 48 kHz", 48_000, gaze(0.8)),
        ("gaze 0, 44.1 kHz, two threads", 44_100, SessionOptions { threads: 2, ..gaze(0.0) }),
        ("gaze 1, 16 kHz, seed 7", 16_000, SessionOptions { seed: 7, ..gaze(1.0) }),
        ("midpoint2, 8 kHz", 8_000, sampler(Sampler::Midpoint2)),
        (
            "midpoint1, 22.05 kHz, f32 cache",
            22_050,
            SessionOptions { diagnostics: wide, ..sampler(Sampler::Midpoint1) },
        ),
        ("euler:5, 96 kHz", 96_000, sampler(Sampler::euler(5).unwrap())),
        ("single, 48 kHz", 48_000, sampler(Sampler::Single)),
        ("single, 11.025 kHz, two threads", 11_025, SessionOptions { threads: 2, ..sampler(Sampler::Single) }),
        ("no stance, guidance 3, 24 kHz", 24_000, SessionOptions { stance: false, guidance: Some(3.0), ..gaze(0.5) }),
    ]
}

fn engine(name: &str, kernels: Kernels) -> std::sync::Arc<Engine> {
    let bundle = BundleFile::open(golden_path(name)).expect("the tiny bundle");
    Engine::from_file(&bundle, kernels).expect("it loads")
}

fn motion(engine: &std::sync::Arc<Engine>, rate: u32, options: SessionOptions) -> u64 {
    let inputs = Inputs::circling(block_seconds(BLOCKS), rate);
    let mut session = engine.session(options).expect("session");
    let mut digest = Digest::new();
    run(&mut session, &inputs, BLOCKS).iter().for_each(|f| digest.frame(f));
    digest.0
}

#[test]
fn motion_has_the_same_bits_on_every_machine() {
    let mut lines =
        String::from("# What tests/machines.rs computes on every machine; VISAVIS_DIGESTS=write rewrites it.\n");
    let tiny = engine(TINY, Kernels::detect().expect("kernels"));
    for rate in [8_000, 11_025, 16_000, 22_050, 32_000, 44_100, 48_000, 96_000, 192_000] {
        let mut digest = Digest::new();
        digest.floats(&resample_to_24k(&Inputs::circling(1.0, rate).agent, rate).expect("resampled"));
        writeln!(lines, "{:016x}  sound of {rate} Hz", digest.0).expect("a string");
    }
    for (name, rate, options) in cases() {
        writeln!(lines, "{:016x}  {name}", motion(&tiny, rate, options)).expect("a string");
    }
    for (backbone, name) in DRAM {
        let dram = engine(name, Kernels::detect().expect("kernels"));
        let options = SessionOptions { gaze: Some(0.8), threads: 2, ..Default::default() };
        writeln!(lines, "{:016x}  dram, {backbone}, two threads", motion(&dram, 48_000, options)).expect("a string");
    }
    let path = golden_path("digests.txt");
    if std::env::var("VISAVIS_DIGESTS").is_ok_and(|v| v == "write") {
        std::fs::write(&path, &lines).expect("written");
    }
    let expected = std::fs::read_to_string(&path).expect("tests/goldens/digests.txt");
    assert_eq!(lines, expected, "left: this machine; right: the file. If the numbers were meant to change, rewrite it");
}

#[test]
fn motion_has_the_same_bits_on_every_level_of_this_cpu() {
    let (name, rate, options) = cases().swap_remove(1);
    for bundle in [TINY, DRAM[0].1, DRAM[1].1] {
        let expected = motion(&engine(bundle, Kernels::detect().expect("kernels")), rate, options.clone());
        for level in Kernels::available() {
            let kernels = Kernels::with_level(level).expect("an available level");
            assert_eq!(
                motion(&engine(bundle, kernels), rate, options.clone()),
                expected,
                "{bundle}: {name} on {level:?}"
            );
        }
    }
}
