//! What a bundle holds, for people (`visavis inspect`).

use serde::Serialize;
use std::fmt;
use visavis::internals::bundle::TensorInfo;
use visavis::internals::config::{AudioConfig, Config, DramConfig, LstmConfig, MospaConfig, TcnConfig};
use visavis::internals::kernels::Scheme;
use visavis::{BundleFile, Engine, Result, Sampler};

/// A bundle's config and tensor list; `Display` prints the summary that `visavis inspect` shows.
#[derive(Debug, Clone, Serialize)]
pub struct Contents {
    /// Size of the file, bytes.
    pub bytes: usize,
    /// The configuration.
    pub config: Config,
    /// Tensors, sorted by name.
    pub tensors: Vec<TensorInfo>,
}

/// Parts of a bundle: name prefix and what it is.
const PARTS: [(&str, &str); 11] = [
    ("audio.", "audio encoder"),
    ("hearing.", "hearing"),
    ("vae.encoder.", "VAE encoder"),
    ("vae.decoder.", "VAE decoder"),
    ("flow.", "flow transformer"),
    ("student.", "single-step student"),
    ("monadic.", "monadic predictor"),
    ("dyadic.", "dyadic predictor"),
    ("mospa.", "denoiser"),
    ("stats.", "normalisation"),
    ("idle.", "idle clip"),
];

impl Contents {
    /// Reads the summary of `file`; weights are not looked at.
    ///
    /// # Errors
    /// As [`BundleFile::parse`].
    pub fn of(file: &BundleFile<'_>) -> Result<Self> {
        let (config, tensors) = file.parse()?;
        Ok(Self { bytes: file.len(), config, tensors: tensors.infos() })
    }
}

impl fmt::Display for Contents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let c = &self.config;
        writeln!(f, "{} (format {}, {:.1} MB)", c.name, c.format, self.bytes as f64 / 1e6)?;
        writeln!(f, "  {}\n", c.description)?;
        writeln!(f, "  part                  tensors   parameters        bytes  storage")?;
        for (prefix, title) in PARTS {
            let part: Vec<_> = self.tensors.iter().filter(|t| t.name.starts_with(prefix)).collect();
            if part.is_empty() {
                continue;
            }
            let mut dtypes: Vec<_> = part.iter().map(|t| t.dtype.as_str()).collect();
            dtypes.sort_unstable();
            dtypes.dedup();
            let (elements, bytes) = part.iter().fold((0, 0), |(e, b), t| (e + t.elements(), b + t.bytes));
            writeln!(f, "  {title:<20} {:>8} {elements:>12} {bytes:>12}  {}", part.len(), dtypes.join(", "))?;
        }
        if let Some(q) = &c.quantisation {
            let count = |scheme| q.tensors.values().filter(|s| **s == scheme).count();
            let schemes = [Scheme::I4, Scheme::I8, Scheme::F16, Scheme::F32].map(|s| (s, count(s)));
            let list: Vec<_> =
                schemes.iter().filter(|(_, n)| *n > 0).map(|(s, n)| format!("{n} matrices {s}")).collect();
            writeln!(f, "\n  quantised to {}: {}", q.scheme, list.join(", "))?;
        }
        if let Some(mospa) = &c.mospa {
            denoiser(mospa, f)?;
            writeln!(f, "  rig      {} joints: {}", c.rig.joints.len(), joint_list(c))?;
            return writeln!(f, "\n  licence  {}", c.licence);
        }
        writeln!(f, "\n  audio    24 kHz, {}", encoder(&c.audio))?;
        if let Some(hearing) = &c.hearing {
            writeln!(f, "  hearing  two ears, {}, embedded in {}", encoder(&hearing.audio), hearing.embed)?;
        }
        match &c.dram {
            None => networks(c, f)?,
            Some(dram) => predictors(dram, f)?,
        }
        writeln!(
            f,
            "  delays   in blocks of 133.3 ms: user {}, agent's own voice {}",
            c.user_delay_blocks, c.agent_delay_blocks
        )?;
        writeln!(f, "  rig      {} joints: {}", c.rig.joints.len(), joint_list(c))?;
        writeln!(f, "\n  licence  {}", c.licence)
    }
}

/// What makes a session's motion, for people: the sampler, or the bundle's kind where there are no
/// samplers.
pub fn made_with(engine: &Engine, sampler: Sampler) -> String {
    if engine.needs_sarah().is_ok() { sampler.to_string() } else { engine.kind().to_owned() }
}

fn encoder(audio: &AudioConfig) -> String {
    let stack: Vec<_> = audio.layers.iter().map(|l| format!("{}/{}", l.outputs, l.stride)).collect();
    format!("convolutions (channels/stride) {}, {} features", stack.join(" "), audio.features)
}

/// The denoiser of the kind `mospa`.
fn denoiser(m: &MospaConfig, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let (layers, width, heads) = (m.layers, m.width, m.heads);
    let seconds = m.frames as f64 / 30.0;
    writeln!(f, "\n  denoiser {layers} layers of width {width}, {heads} heads, {} frames a token", m.patch)?;
    writeln!(f, "  clip     {} frames ({seconds:.1} s) at once: `visavis react`, no sessions", m.frames)?;
    writeln!(f, "  steps    {} of {} diffusion steps by default", m.steps, m.diffusion_steps)
}

/// The predictors of the kind `dram`.
fn predictors(dram: &DramConfig, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let tcn = |c: &TcnConfig| {
        let frames = c.dilations.iter().sum::<usize>() + 1;
        let layers = c.dilations.len();
        format!("{layers} dilated layers of width {}, window {frames} frames ({:.1} s)", c.width, frames as f64 / 30.0)
    };
    let lstm = |c: &LstmConfig| format!("{} LSTM layers of width {}", c.layers, c.width);
    let [monadic, dyadic] = match dram {
        DramConfig::Tcn { monadic, dyadic } => [tcn(monadic), tcn(dyadic)],
        DramConfig::Lstm { monadic, dyadic } => [lstm(monadic), lstm(dyadic)],
    };
    writeln!(f, "  monadic  {monadic}")?;
    writeln!(f, "  dyadic   {dyadic}")?;
    writeln!(f, "  steps    a frame each, deterministic: no samplers, guidance or calibration")
}

/// The networks of the kind `sarah`.
fn networks(c: &Config, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let v = &c.vae;
    writeln!(
        f,
        "  VAE      {} + {} layers of width {}, {} heads, latent {}, window {} blocks",
        v.layers, v.layers, v.width, v.heads, v.latent, v.window_blocks
    )?;
    let w = &c.flow;
    writeln!(
        f,
        "  flow     {} layers of width {}, {} heads, window {} blocks ({:.1} s)",
        w.layers,
        w.width,
        w.heads,
        w.window_blocks,
        w.window_blocks as f64 * 4.0 / 30.0
    )?;
    match c.student {
        Some(s) => writeln!(
            f,
            "  student  single step, history at tau {}, guidance {} and gaze guidance {} distilled in{}",
            s.tau_history,
            s.guidance,
            s.gaze_guidance,
            s.temperature.map_or_else(String::new, |t| format!(", temperature {t}"))
        )?,
        None => writeln!(f, "  student  none: the sampler \"single\" is not available")?,
    }
    match &c.gaze {
        Some(g) => writeln!(
            f,
            "  gaze     calibrated; free gaze {:.2} to {:.2} in stretches of {:.1} s",
            g.levels.iter().copied().fold(f32::INFINITY, f32::min),
            g.levels.iter().copied().fold(f32::NEG_INFINITY, f32::max),
            g.seconds
        )?,
        None => writeln!(f, "  gaze     not calibrated: targets are values of the gaze channel (`visavis calibrate`)")?,
    }
    if let Some(rest) = &c.rest {
        let calibrated = if rest.reference.is_some() { "calibrated" } else { "not calibrated (`visavis calibrate`)" };
        let (count, own) = (rest.levels.len(), rest.reference.as_ref());
        let seconds = own.map_or(rest.seconds, |own| own.seconds);
        writeln!(f, "  rest     {calibrated}; as active as one of {count} stretches of people, for {seconds:.1} s")?;
    }
    Ok(())
}

fn joint_list(config: &Config) -> String {
    config.rig.joints.iter().map(|j| j.name.as_str()).collect::<Vec<_>>().join(" ")
}
