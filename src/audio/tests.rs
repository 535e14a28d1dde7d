//! Tests of the resampler and the voice.

use super::*;
use crate::error::ErrorKind;
use crate::frame::BLOCK_SAMPLES;
use proptest::prelude::*;
use std::f64::consts::TAU;

const RATES: [u32; 10] = [8_000, 11_025, 16_000, 22_050, 23_999, 32_000, 44_100, 48_000, 96_000, 192_000];

fn sine(hertz: f64, rate: u32, count: usize) -> Vec<f32> {
    (0..count).map(|i| (TAU * hertz * i as f64 / f64::from(rate)).sin() as f32).collect()
}

/// Deterministic noise in -1 to 1.
pub(super) fn noise(seed: u32, count: usize) -> Vec<f32> {
    let mut state = seed.wrapping_mul(2_654_435_761).max(1);
    (0..count)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            state as f32 / 2f32.powi(31) - 1.0
        })
        .collect()
}

#[test]
fn output_n_is_the_input_at_n_over_24000() {
    // The ideal answer is the same sine sampled at 24 kHz; the ends are left out (silence outside
    // is a step).
    for rate in RATES {
        let out = resample_to_24k(&sine(997.0, rate, rate as usize), rate).unwrap();
        assert_eq!(out.len(), 24_000);
        let want = sine(997.0, 24_000, out.len());
        let worst = (300..out.len() - 300).map(|i| (out[i] - want[i]).abs()).fold(0.0, f32::max);
        assert!(worst < 5e-5, "{rate} Hz: off by {worst}");
    }
}

#[test]
fn what_24_khz_cannot_hold_is_removed() {
    for (rate, hertz) in [(44_100, 15_000.0), (48_000, 17_000.0), (192_000, 50_000.0)] {
        let out = resample_to_24k(&sine(hertz, rate, rate as usize / 4), rate).unwrap();
        let worst = out[300..out.len() - 300].iter().fold(0f32, |m, s| m.max(s.abs()));
        assert!(worst < 5e-6, "{hertz} Hz at {rate} Hz leaves {worst}");
    }
}

#[test]
fn the_own_rate_passes_untouched() {
    let input = noise(3, 5_000);
    assert_eq!(resample_to_24k(&input, 24_000).unwrap(), input);
    assert_eq!(Resampler::new(24_000).unwrap().latency_samples(), 0);
}

#[test]
fn latency_is_as_said() {
    for rate in RATES {
        let mut resampler = Resampler::new(rate).unwrap();
        let (mut pushed, mut given, mut worst) = (0u64, 0u64, 0);
        for piece in noise(1, 20_000).chunks(7) {
            resampler.push(piece, |s| given += s.len() as u64);
            pushed += piece.len() as u64;
            worst = worst.max((pushed * 24_000 / u64::from(rate)).saturating_sub(given));
        }
        let said = resampler.latency_samples() as u64;
        assert!(worst <= said && said <= worst + 4, "{rate} Hz: {worst} against {said}");
    }
}

#[test]
fn rates_out_of_range_are_refused() {
    for rate in [0, 7_999, 192_001, u32::MAX] {
        assert_eq!(resample_to_24k(&[0.0], rate).unwrap_err().kind(), ErrorKind::Audio);
        assert_eq!(Voice::new().input().push(&[0.0], rate).unwrap_err().kind(), ErrorKind::Audio);
    }
}

pub(super) fn block(voice: &mut Voice, index: u64) -> (bool, Vec<f32>) {
    let mut out = [9.0; BLOCK_SAMPLES];
    voice.look();
    let present = voice.take_block(index, &mut out).unwrap();
    (present, out.to_vec())
}

#[test]
fn absent_is_not_silent_and_late_sound_follows_after_silence() {
    let mut voice = Voice::with_capacity(1.0);
    assert_eq!(block(&mut voice, 0), (false, vec![0.0; 3200]));
    assert_eq!(voice.stats().underrun_samples, 0);
    voice.input().push(&[], 24_000).unwrap();
    assert!(!voice.is_present());
    voice.input().push(&[0.5; 1_000], 24_000).unwrap();
    let (present, got) = block(&mut voice, 1);
    assert!(present && got[..1_000] == [0.5; 1_000] && got[1_000..] == [0.0; 2_200]);
    assert_eq!(voice.stats().underrun_samples, 2_200);
    voice.input().push(&[0.25; 3_200], 24_000).unwrap();
    assert_eq!(block(&mut voice, 2), (true, vec![0.25; 3_200]));
    voice.input().set_present(false);
    assert_eq!(block(&mut voice, 4), (false, vec![0.0; 3_200]));
    let e = voice.take_block(4, &mut [0.0; 3_200]).unwrap_err();
    assert_eq!(e.kind(), ErrorKind::State);
    assert!(voice.take_block(u64::MAX, &mut [0.0; 3_200]).is_err());
    assert_eq!(voice.stats().underrun_samples, 2_200);
    voice.reset_at(0);
    assert_eq!(voice.stats(), VoiceStats::default());
    assert!(voice.take_block(0, &mut [0.0; 3_200]).is_ok());
}

#[test]
fn too_much_is_dropped_and_counted() {
    let mut voice = Voice::with_capacity(1.0);
    let input = noise(5, 30_000);
    voice.input().push(&input, 24_000).unwrap();
    assert_eq!(voice.stats().overflow_samples, 6_000);
    for (k, want) in input[..24_000].chunks(3_200).enumerate() {
        let (_, got) = block(&mut voice, k as u64);
        assert_eq!(got[..want.len()], *want);
        assert!(got[want.len()..].iter().all(|&s| s == 0.0));
    }
    voice.input().push(&input, 24_000).unwrap();
    voice.input().clear();
    assert!(voice.is_present());
    assert_eq!(block(&mut voice, 8), (true, vec![0.0; 3_200]));
}

#[test]
fn a_change_of_rate_leaves_no_gap() {
    let mut voice = Voice::with_capacity(4.0);
    let mut hear = Vec::new();
    for rate in [48_000, 24_000, 16_000, 44_100] {
        voice.input().push(&sine(500.0, rate, rate as usize / 2), rate).unwrap();
    }
    voice.input().finish();
    for k in 0..16 {
        hear.extend(block(&mut voice, k).1);
    }
    let lag = voice.lag_samples();
    assert_eq!(lag, Resampler::new(16_000).unwrap().latency_samples());
    // Each half second is 250 whole periods, so the sine goes on across the seams; lags add up to
    // the largest.
    let first = Resampler::new(48_000).unwrap().latency_samples();
    for (from, to, lag) in [(0, 24_000, first), (24_000, 48_000, lag)] {
        let want = sine(500.0, 24_000, to - from);
        for i in from..to {
            let seam = i % 12_000;
            let near = (12_000 - seam).min(seam) < 70;
            let error = (hear[i + lag] - want[i - from]).abs();
            assert!(error < if near { 0.6 } else { 5e-5 }, "sample {i} is off by {error}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_chunking_gives_the_same_bits(
        rate in prop::sample::select(&RATES[..]),
        cuts in prop::collection::vec(0usize..900, 1..40),
        seed in 1u32..1000,
    ) {
        let input = noise(seed, cuts.iter().sum());
        let whole = resample_to_24k(&input, rate).unwrap();
        let mut resampler = Resampler::new(rate).unwrap();
        let (mut out, mut at) = (Vec::new(), 0);
        // The second time round shows that `finish` starts afresh.
        for _ in 0..2 {
            out.clear();
            at = 0;
            for cut in &cuts {
                resampler.push(&input[at..at + cut], |s| out.extend_from_slice(s));
                at += cut;
            }
            resampler.finish(|s| out.extend_from_slice(s));
            prop_assert_eq!(&out, &whole);
        }
        prop_assert_eq!(out.len() as u64, (at as u64 * 24_000).div_ceil(u64::from(rate)));
    }

    #[test]
    fn when_it_is_pushed_does_not_change_what_is_heard(
        rate in prop::sample::select(&[8_000u32, 24_000, 44_100, 48_000][..]),
        ahead in prop::collection::vec(0usize..4_000, 6),
    ) {
        // Block k may be taken as soon as its own time has been pushed.
        let input = noise(9, 2 * rate as usize);
        let mut at_once = Voice::with_capacity(2.0);
        at_once.input().push(&input, rate).unwrap();
        let mut live = Voice::with_capacity(2.0);
        let mut pushed = 0;
        for (k, ahead) in ahead.iter().enumerate() {
            let until = ((k + 1) * rate as usize * 4).div_ceil(30) + ahead * rate as usize / 24_000;
            live.input().push(&input[pushed.min(until)..until], rate).unwrap();
            pushed = pushed.max(until);
            prop_assert_eq!(block(&mut live, k as u64), block(&mut at_once, k as u64));
        }
        prop_assert_eq!(live.stats().underrun_samples, 0);
    }
}
