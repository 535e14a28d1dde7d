//! Statistics of a session, as a row of doubles in the order of `org.visavis.SessionStats`.

use crate::error::{Outcome, Throw};
use crate::native;
use crate::session::with;
use jni::Env;
use jni::objects::{JClass, JDoubleArray};
use jni::sys::jlong;
use visavis::stats::{SessionStats, VoiceStats};

native!("Java_org_visavis_Native_stats": stats(session: jlong) -> jdouble[]);

fn stats<'l>(env: &mut Env<'l>, _: JClass<'l>, session: jlong) -> Outcome<JDoubleArray<'l>> {
    let row = row(&with(session, |s| Ok(s.stats()))?);
    let array = JDoubleArray::new(env, row.len())?;
    array.set_region(env, 0, &row)?;
    Ok(array)
}

/// Counts below 2^53 are exact.
fn row(s: &SessionStats) -> Vec<f64> {
    let voice = |v: &VoiceStats| {
        let lost = [v.underrun_samples, v.overflow_samples, v.clipped_samples];
        let refused = [v.non_finite_samples, v.bad_rate_samples, v.contended_samples];
        lost.into_iter().chain(refused).map(|n| n as f64)
    };
    let head = s.inputs.head;
    let mut row = vec![s.blocks as f64];
    row.extend(s.block_ms);
    row.extend([s.delays.user_ms, s.delays.agent_ms, s.anchorings as f64, s.cache_bytes as f64]);
    row.extend(voice(&s.inputs.agent_voice));
    row.extend(voice(&s.inputs.user_voice));
    row.extend(
        [head.accepted, head.non_finite, head.out_of_order, head.absurd, head.teleports, head.overwritten]
            .map(|n| n as f64),
    );
    let v = s.inputs.sounds;
    row.extend([v.pieces, v.started, v.overflow_samples, v.clipped_samples, v.non_finite_samples].map(|n| n as f64));
    row.extend([v.bad_rate_samples, v.bad_places, v.contended_samples, v.refused, v.replaced].map(|n| n as f64));
    let g = s.governor;
    row.extend([g.missed, g.down, g.up, g.held_blocks, g.fallback_blocks, g.catch_up_passes].map(|n| n as f64));
    row.extend([s.guard.trips, s.guard.held_frames].map(|n| n as f64));
    row
}
