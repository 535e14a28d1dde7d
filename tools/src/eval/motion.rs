//! The model's motion under given voices and a given path of the user.

use super::clip::Segment;
use super::window::{LEAD, Window};
use crate::offline::UserPath;
use crate::offline::{Conversation, Outcome, run};
use glam::{Quat, Vec3};
use std::sync::Arc;
use visavis::{Engine, FPS, Frame, Result, SessionOptions};

/// Runs a session over voices (full scale 1) and a user's head (one position per frame, and where
/// it was recorded one rotation; none: nobody is seen).
pub(super) fn generate(
    engine: &Arc<Engine>,
    options: SessionOptions,
    [agent, user]: [Option<Vec<f32>>; 2],
    head: impl IntoIterator<Item = Vec3>,
    rotations: Option<&[Quat]>,
) -> Result<Outcome> {
    let at = |i: usize| i as f64 / f64::from(FPS);
    let mut points: Vec<_> = head.into_iter().enumerate().map(|(i, p)| (at(i), p)).collect();
    // A path ends with its last point; the last frame has a length too.
    points.extend(points.last().map(|(_, p)| (at(points.len()), *p)));
    let count = points.len();
    let path = match rotations {
        _ if count == 0 => None,
        None => Some(UserPath::from_points(points)?),
        Some(all) => {
            let turned = all.iter().chain(all.last()).copied().take(count).collect();
            Some(UserPath::from_points(points)?.with_rotations(turned)?)
        }
    };
    let talk = Conversation::new(agent, user, path)?;
    run(&mut engine.session(options)?, &talk, &mut |_| {})
}

/// The model's motion in a window: a session that starts where the clip's agent stands, without
/// what leads in.
pub(super) fn in_window(engine: &Arc<Engine>, options: &SessionOptions, window: &Window) -> Result<Vec<Frame>> {
    let Segment { frames, user, user_rotation, .. } = &window.segment;
    let options = SessionOptions { start: frames[0].root, ..options.clone() };
    let voices = [window.segment.agent(), window.segment.user()];
    let mut motion =
        generate(engine, options, voices, user.iter().copied(), user_rotation.as_deref())?.recording.frames;
    motion.truncate(frames.len());
    Ok(motion.split_off(LEAD))
}
