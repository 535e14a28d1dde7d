//! `visavis locate`: what two microphones hear in, where it comes from out.

use super::args::LocateArgs;
use super::print;
use glam::{Quat, Vec3};
use std::fmt::Write;
use std::path::Path;
use visavis::internals::hearing;
use visavis::{BLOCK_FRAMES, Error, ErrorKind, FPS, Result, SAMPLE_RATE, Transform};
use visavis_tools::offline::Ears;

/// Longest list of turns that is read, bytes.
const MAX_BYTES: u64 = 1 << 26;

pub fn run(args: &LocateArgs) -> Result<()> {
    let ears = Ears::read(&args.ears)?;
    let turns = args.turns.as_deref().map_or_else(|| Ok(vec![(0.0, 0.0)]), turns)?;
    let frames = (ears.end() * f64::from(FPS)) as usize;
    let head = |t: usize| {
        let yaw = yaw_at(&turns, t as f64 / f64::from(FPS)).to_radians();
        Transform { position: Vec3::new(0.0, 1.6, 0.0), rotation: Quat::from_rotation_y(yaw as f32) }
    };
    let heads: Vec<_> = (0..frames).map(head).collect();
    let before = vec![0.0; (ears.start * f64::from(SAMPLE_RATE)) as usize];
    let [left, right] = ears.samples.each_ref().map(|ear| [&before[..], ear].concat());
    let mut text = String::from("t,azimuth\n");
    for (block, place) in hearing::locate([&left, &right], SAMPLE_RATE, &heads)?.into_iter().enumerate() {
        let azimuth = place.map_or_else(String::new, |p| format!("{:.1}", libm::atan2f(p.x, p.z).to_degrees()));
        let until = ((block + 1) * BLOCK_FRAMES) as f64 / f64::from(FPS);
        // Writing to a string does not fail.
        let _ = writeln!(text, "{until:.3},{azimuth}");
    }
    print(&text)
}

/// The yaw at a time, degrees: in a straight line from row to row.
fn yaw_at(turns: &[(f64, f64)], time: f64) -> f64 {
    let after = turns.partition_point(|(t, _)| *t <= time);
    match (after.checked_sub(1).map(|i| turns[i]), turns.get(after).copied()) {
        (Some((t, yaw)), Some((next, then))) => yaw + (time - t) / (next - t) * (then - yaw),
        (Some((_, yaw)), None) | (None, Some((_, yaw))) => yaw,
        (None, None) => 0.0,
    }
}

/// Rows of a CSV with the header `t,yaw`: seconds, ascending, and degrees.
fn turns(path: &Path) -> Result<Vec<(f64, f64)>> {
    let bytes = visavis::internals::bounded::read(path, MAX_BYTES).map_err(|e| Error::io("read the turns", path, e))?;
    let bad = |line: usize| {
        let message = format!("line {line}: turns are CSV with the header t,yaw, seconds, ascending, and degrees");
        Error::new(ErrorKind::Argument, message).with_path(path)
    };
    let text = String::from_utf8_lossy(&bytes);
    let mut lines = text.lines().map(str::trim);
    if lines.next() != Some("t,yaw") {
        return Err(bad(1));
    }
    let mut rows = Vec::new();
    for (i, line) in lines.enumerate().filter(|(_, line)| !line.is_empty()) {
        let row = line.split_once(',').and_then(|(t, yaw)| Some((t.trim().parse().ok()?, yaw.trim().parse().ok()?)));
        let (t, yaw): (f64, f64) = row.ok_or_else(|| bad(i + 2))?;
        if !t.is_finite() || !yaw.is_finite() || rows.last().is_some_and(|(before, _)| *before >= t) {
            return Err(bad(i + 2));
        }
        rows.push((t, yaw));
    }
    if rows.is_empty() { Err(bad(2)) } else { Ok(rows) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn yaws_go_in_straight_lines() {
        let turns = [(1.0, 0.0), (2.0, 40.0)];
        for (time, yaw) in [(0.0, 0.0), (1.0, 0.0), (1.5, 20.0), (2.0, 40.0), (9.0, 40.0)] {
            assert_eq!(yaw_at(&turns, time), yaw, "{time}");
        }
    }
}
