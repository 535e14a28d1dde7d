//! What the bridge promises of decoded motion, by the measures of the reports.

use glam::Quat;
use visavis::internals::kernels::Kernels;
use visavis::internals::normaliser::Metric;
use visavis::internals::pose::synthetic::{self, Noise, Walk};
use visavis::internals::pose::{Decoder, Encoder, feature_count, root_of};
use visavis::{BLOCK_FRAMES, Frame};
use visavis_tools::metrics::{bone_deviation, seam};

const RADIUS: f32 = 0.1;

#[test]
fn bones_keep_their_length() {
    let walk = jittery(40, 0.15);
    let frames = decoded(&walk, Some(1.5));
    let deviation = bone_deviation(&walk.rig, &frames).unwrap();
    assert!(deviation.max < 1e-4, "{deviation:?}");
}

#[test]
fn seams_go_back_to_one() {
    let walk = jittery(600, 0.06);
    let (raw, smooth) = (seam(&decoded(&walk, None)).unwrap(), seam(&decoded(&walk, Some(1.5))).unwrap());
    assert!(raw > 1.5, "without a bridge {raw}");
    assert!((0.5..1.15).contains(&smooth), "with it {smooth}");
}

/// A walk whose joints are off by a fresh small rotation (`amount` rad) in each block.
fn jittery(frames: usize, amount: f32) -> Walk {
    let mut walk = synthetic::walk(frames);
    let mut noise = Noise::new(3);
    for block in walk.frames.chunks_mut(BLOCK_FRAMES) {
        let off: Vec<Quat> = (0..walk.rig.len()).map(|_| Quat::from_scaled_axis(noise.vector() * amount)).collect();
        for frame in block {
            for (local, off) in frame.local.iter_mut().zip(&off).skip(1) {
                *local = *off * *local;
            }
            walk.rig.fk(frame.hips, &frame.local, &mut frame.global);
            frame.root = root_of(&frame.global[0], 0.0);
        }
    }
    walk
}

/// The walk encoded and decoded, bridged with a time constant of `frames` frames or not at all.
fn decoded(walk: &Walk, frames: Option<f32>) -> Vec<Frame> {
    let mut decoder = Decoder::new(Kernels::detect().unwrap(), &walk.rig, RADIUS);
    if let Some(frames) = frames {
        decoder = decoder.with_bridge(&walk.rig, frames);
    }
    let mut encoder = Encoder::new(RADIUS);
    let width = feature_count(walk.rig.len());
    let mut x = Metric::zeros(BLOCK_FRAMES * width);
    let mut out = walk.frames.clone();
    for block in out.chunks_exact_mut(BLOCK_FRAMES) {
        for (i, frame) in block.iter().enumerate() {
            encoder.encode(frame.root, &frame.global, x.part_mut(i..i + 1, width));
        }
        decoder.decode_block(x.view(), block).unwrap();
    }
    out
}
