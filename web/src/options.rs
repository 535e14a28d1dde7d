//! Options of a session, from JSON.

use serde::Deserialize;
use visavis::{Error, ErrorKind, Governor, Result, Root, SessionOptions};

/// What is not named has the runtime's default.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields, default)]
struct Wishes {
    sampler: String,
    seed: u64,
    gaze: Option<f32>,
    guidance: Option<f32>,
    gaze_guidance: Option<f32>,
    temperature: Option<f32>,
    budget: f32,
    start: [f64; 3],
    stance: bool,
    guard: bool,
    voice_ahead: f64,
    sensitivity: f32,
}

impl Default for Wishes {
    fn default() -> Self {
        Self {
            sampler: SessionOptions::default().sampler.to_string(),
            seed: 0,
            gaze: None,
            guidance: None,
            gaze_guidance: None,
            temperature: None,
            budget: 0.0,
            start: [0.0; 3],
            stance: true,
            guard: true,
            voice_ahead: SessionOptions::default().voice_ahead,
            sensitivity: 0.0,
        }
    }
}

pub(crate) fn parse(json: &[u8]) -> Result<SessionOptions> {
    let wishes: Wishes = serde_json::from_slice(json)
        .map_err(|e| Error::new(ErrorKind::Argument, format!("options of the session: {e}")))?;
    let [x, z, yaw] = wishes.start;
    Ok(SessionOptions {
        sampler: wishes.sampler.parse()?,
        seed: wishes.seed,
        gaze: wishes.gaze,
        guidance: wishes.guidance,
        gaze_guidance: wishes.gaze_guidance,
        temperature: wishes.temperature,
        governor: Governor::within(wishes.budget),
        start: Root { x, z, yaw },
        stance: wishes.stance,
        guard: wishes.guard,
        voice_ahead: wishes.voice_ahead,
        sensitivity: wishes.sensitivity,
        ..SessionOptions::default()
    })
}
