//! Ranges of a config. They bound what an engine and its sessions allocate before any tensor has
//! been looked at.
//!
//! Weights are bounded by the file's own size, since each tensor must have the shape that the
//! config gives. Caches and scratch are not, so what a session would take is counted and must not
//! exceed [`MAX_SESSION`].

use super::invalid;
use crate::audio::check_audio_config;
use crate::config::{
    AudioConfig, Config, DramConfig, GazeConfig, HearingConfig, Kind, LstmConfig, MospaConfig, ResponseCurve,
    RestConfig, TcnConfig,
};
use crate::error::Result;
use crate::frame::feature_count;
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES};

/// Most memory that a session may take for caches and scratch, bytes. Sessions of the shipped model
/// take 20 MB, those of a model of the size in the SARAH paper 60 MB.
const MAX_SESSION: u128 = 1 << 30;

/// Checks every number of `config` against its range.
pub(super) fn config(c: &Config) -> Result<()> {
    c.rig.check()?;
    match (c.kind, &c.dram, &c.mospa) {
        (Kind::Sarah, None, None) => conversation(c).and_then(|()| sarah(c))?,
        (Kind::Dram, Some(dram), None) => conversation(c).and_then(|()| self::dram(c, dram))?,
        (Kind::Mospa, None, Some(mospa)) => return self::mospa(mospa),
        _ => {
            let kind = c.kind.name();
            return Err(invalid(format!(
                "the config is of kind `{kind}`, and its networks are not; export the bundle again"
            )));
        }
    }
    affordable("session", session_bytes(c), "widths, layers or windows")
}

/// Checks that a `what` takes no more `bytes` than any needs; else `suspects` of the config are
/// wrong.
fn affordable(what: &str, bytes: u128, suspects: &str) -> Result<()> {
    if bytes <= MAX_SESSION {
        return Ok(());
    }
    let (mib, most) = (bytes >> 20, MAX_SESSION >> 20);
    Err(invalid(format!(
        "a {what} of this model would take {mib} MiB, more than {most}: the config's {suspects} are wrong; \
         export the bundle again"
    )))
}

/// Checks what sessions of every kind go by.
fn conversation(c: &Config) -> Result<()> {
    within("user_delay_blocks", c.user_delay_blocks as usize, 1, 4)?;
    within("agent_delay_blocks", c.agent_delay_blocks as usize, 0, 4)?;
    within("audio.layers", c.audio.layers.len(), 1, 32)?;
    check_audio_config(&c.audio)?;
    real("session.bridge", c.session.bridge, 0.0, 30.0)
}

/// Checks the denoiser of the kind `mospa`.
fn mospa(m: &MospaConfig) -> Result<()> {
    within("mospa.frames", m.frames, 9, 7200)?;
    within("mospa.patch", m.patch, 1, 64)?;
    width("mospa.width", m.width, m.heads)?;
    within("mospa.layers", m.layers, 1, 64)?;
    within("mospa.mlp", m.mlp, 1, 16)?;
    within("mospa.diffusion_steps", m.diffusion_steps, 1, 1000)?;
    within("mospa.steps", m.steps, 1, m.diffusion_steps)?;
    if !m.frames.is_multiple_of(m.patch) {
        return Err(invalid(format!(
            "mospa.frames is {}: it must be a multiple of mospa.patch, {}",
            m.frames, m.patch
        )));
    }
    let tokens = 3 + 2 * m.frames / m.patch;
    let bytes = [4, tokens, m.width, 7 + m.mlp].iter().map(|n| *n as u128).product::<u128>();
    affordable("clip", bytes, "frames, patch or width")
}

/// Checks the networks of the kind `sarah`.
fn sarah(c: &Config) -> Result<()> {
    real("pose.radius", c.pose.radius, 0.001, 10.0)?;
    let v = &c.vae;
    within("vae.layers", v.layers, 1, 64)?;
    width("vae.width", v.width, v.heads)?;
    within("vae.mlp", v.mlp, 1, 16)?;
    within("vae.latent", v.latent, 1, 4096)?;
    within("vae.window_blocks", v.window_blocks, 1, 1024)?;

    let w = &c.flow;
    within("flow.layers", w.layers, 1, 64)?;
    width("flow.width", w.width, w.heads)?;
    within("flow.mlp", w.mlp, 1, 16)?;
    within("flow.tau_width", w.tau_width, 2, 4096)?;
    if !w.tau_width.is_multiple_of(2) {
        return Err(invalid("flow.tau_width must be even: half cosines, half sines"));
    }
    within("flow.window_blocks", w.window_blocks, 2, 1024)?;
    let embeds = [
        ("flow.embed_latent", w.embed_latent),
        ("flow.embed_user", w.embed_user),
        ("flow.embed_voice", w.embed_voice),
        ("flow.embed_gaze", w.embed_gaze),
    ];
    for (name, value) in embeds {
        within(name, value, 1, 4096)?;
    }
    real("flow.user_scale", w.user_scale, 0.001, 1000.0)?;
    if let Some(s) = &c.student {
        real("student.tau_history", s.tau_history, 0.0, 1.0)?;
        real("student.guidance", s.guidance, 0.0, 20.0)?;
        real("student.gaze_guidance", s.gaze_guidance, 0.0, 20.0)?;
        real("student.temperature", s.temperature.unwrap_or(1.0), 0.0, 2.0)?;
    }
    real("session.guidance", c.session.guidance, 0.0, 20.0)?;
    real("session.gaze_guidance", c.session.gaze_guidance, 0.0, 20.0)?;
    real("session.temperature", c.session.temperature, 0.0, 2.0)?;
    real("session.guided_until", c.session.guided_until.unwrap_or(1.0), 0.0, 1.0)?;
    if let Some(h) = &c.session.clean_history {
        real("session.clean_history.tau", h.tau, 0.0, 1.0)?;
        real("session.clean_history.from", h.from, 0.0, 1.0)?;
    }
    within("session.anchor_period", c.session.anchor_period as usize, 0, 1 << 20)?;
    real("session.anchor_radius", c.session.anchor_radius, 0.1, 1e6)?;
    if let Some(g) = &c.gaze {
        gaze(g)?;
    }
    if let Some(r) = &c.rest {
        rest(r)?;
    }
    if let Some(h) = &c.hearing {
        within("hearing.audio.layers", h.audio.layers.len(), 1, 32)?;
        check_audio_config(&h.audio).map_err(|e| invalid(format!("the config's hearing: {e}")))?;
        within("hearing.audio.features", h.audio.features, 1, 4096)?;
        within("hearing.embed", h.embed, 1, 4096)?;
        within("hearing.appraisal.width", h.appraisal.width, 1, 1024)?;
        within("hearing.appraisal.reactions", h.appraisal.reactions.len(), 1, 64)?;
        real("hearing.guidance", h.guidance, 0.0, 20.0)?;
        // What was heard is heard at the head of the frames before.
        within("user_delay_blocks", c.user_delay_blocks as usize, 1, 1)?;
    }
    Ok(())
}

/// Checks the predictors of the kind `dram`. Their inputs are those of one block before
/// (`dram/inputs.rs`), whatever a bundle says.
fn dram(c: &Config, dram: &DramConfig) -> Result<()> {
    within("user_delay_blocks", c.user_delay_blocks as usize, 1, 1)?;
    within("agent_delay_blocks", c.agent_delay_blocks as usize, 0, 0)?;
    let tcn = |part: &str, c: &TcnConfig| {
        within(&format!("dram.{part}.width"), c.width, 1, 4096)?;
        within(&format!("dram.{part}.dilations"), c.dilations.len(), 1, 32)?;
        c.dilations.iter().try_for_each(|d| within(&format!("dram.{part}.dilations"), *d, 1, 4096))
    };
    let lstm = |part: &str, c: &LstmConfig| {
        within(&format!("dram.{part}.width"), c.width, 1, 4096)?;
        within(&format!("dram.{part}.layers"), c.layers, 1, 16)
    };
    match dram {
        DramConfig::Tcn { monadic, dyadic } => tcn("monadic", monadic).and(tcn("dyadic", dyadic)),
        DramConfig::Lstm { monadic, dyadic } => lstm("monadic", monadic).and(lstm("dyadic", dyadic)),
    }
}

/// Checks what was measured of the gaze channel.
fn gaze(g: &GazeConfig) -> Result<()> {
    g.curves().try_for_each(|(name, response)| curve(&format!("gaze.{name}"), response, 1.0))?;
    within("gaze.levels", g.levels.len(), 1, 1024)?;
    for level in &g.levels {
        real("gaze.levels", *level, -1.0, 1.0)?;
    }
    real("gaze.seconds", g.seconds, 0.1, 3600.0)
}

/// Checks a curve of a channel, on both sides of which values lie within `most` of 0.
fn curve(name: &str, ResponseCurve(points): &ResponseCurve, most: f32) -> Result<()> {
    within(name, points.len(), 1, 64)?;
    points.as_flattened().iter().try_for_each(|value| real(name, *value, -most, most))?;
    if points.windows(2).any(|pair| pair[1][0] <= pair[0][0] || pair[1][1] <= pair[0][1]) {
        return Err(invalid(format!("{name}: responses and channel values must both ascend")));
    }
    Ok(())
}

/// Checks what the networks are told at rest.
fn rest(r: &RestConfig) -> Result<()> {
    within("rest.embed", r.embed, 1, 4096)?;
    real("rest.seconds", r.seconds, 0.1, 3600.0)?;
    within("rest.levels", r.levels.len(), 1, 4096)?;
    r.levels.as_flattened().iter().try_for_each(|value| real("rest.levels", *value, -4.0, 4.0))?;
    r.responses().try_for_each(|(network, response)| {
        let name = format!("rest.{network}");
        real(&name, response.seconds, 0.1, 3600.0)?;
        response.curves.iter().try_for_each(|own| curve(&name, own, 4.0))?;
        let mut offsets = response.alone.iter().chain(&response.listening);
        offsets.try_for_each(|offset| real(&name, *offset, -8.0, 8.0))
    })
}

/// Bytes that a session takes at most, caches in f32; slots of their own that Euler samplers ask
/// for come on top.
fn session_bytes(c: &Config) -> u128 {
    let product = |factors: &[usize]| factors.iter().map(|n| *n as u128).product::<u128>();
    let (v, w) = (&c.vae, &c.flow);
    let features = feature_count(c.rig.joints.len());
    // Keys and values of eight slots with three branches and of the student.
    let flow = product(&[2, 25, w.layers, w.window_blocks + 8, w.width]);
    // Encoder, two decoders; six tokens per block.
    let vae = product(&[2, 3, v.layers, 6 * v.window_blocks, v.width]);
    let tokens = product(&[w.window_blocks + 9, 2 * v.latent + 8 + 8 * c.audio.features + 3 * w.width]);
    let anchor = product(&[w.window_blocks + 1, BLOCK_FRAMES * features + v.latent]);
    let rows = product(&[27, w.width, 12 + w.mlp]) + product(&[6, v.width, 12 + v.mlp]);
    let modulation = product(&[9, 2, 6 * w.layers + 2, w.width]);
    let predictors = c.dram.as_ref().map_or(0, |dram| {
        let tcn = |c: &TcnConfig| product(&[c.dilations.iter().sum::<usize>() + 8, c.width]);
        let lstm = |c: &LstmConfig| product(&[2 * c.layers + 8, c.width]);
        match dram {
            DramConfig::Tcn { monadic, dyadic } => tcn(monadic) + tcn(dyadic),
            DramConfig::Lstm { monadic, dyadic } => lstm(monadic) + lstm(dyadic),
        }
    });
    let encoder = |audio: &AudioConfig| {
        let mut samples = BLOCK_SAMPLES;
        let layers = audio.layers.iter().map(|layer| {
            let input = product(&[samples + layer.kernel, layer.inputs]) + product(&[64, layer.kernel, layer.inputs]);
            samples /= layer.stride;
            input
        });
        layers.sum::<u128>()
    };
    let appraisal = |h: &HearingConfig| product(&[12, h.appraisal.width + h.audio.features]);
    // The sources' samples, ten seconds each, come on top: they are the same for all models.
    let hearing =
        c.hearing.as_ref().map_or(0, |h| encoder(&h.audio) + product(&[w.window_blocks + 9, h.width()]) + appraisal(h));
    4 * (flow + vae + tokens + anchor + rows + modulation + predictors + 2 * encoder(&c.audio) + hearing)
}

fn width(name: &str, width: usize, heads: usize) -> Result<()> {
    within(name, width, 2, 8192)?;
    within(&name.replace("width", "heads"), heads, 1, 128)?;
    if !width.is_multiple_of(2 * heads) {
        return Err(invalid(format!("{name} is {width}: it must be an even multiple of its {heads} heads")));
    }
    Ok(())
}

fn within(name: &str, value: usize, low: usize, high: usize) -> Result<()> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(invalid(format!("the config's {name} is {value}, outside {low} to {high}; export the bundle again")))
}

fn real(name: &str, value: f32, low: f32, high: f32) -> Result<()> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(invalid(format!("the config's {name} is {value}, outside {low} to {high}; export the bundle again")))
}
