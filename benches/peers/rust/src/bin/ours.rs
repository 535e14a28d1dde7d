//! Visavis itself, through its public interface:
//!
//! ```text
//! ours config paper|base                          the configuration of a size, JSON
//! ours quantize IN OUT SCHEME                    a bundle of floats to f16, i8 or i4, each weight to the nearest value
//! ours trace BUNDLE IN OUT                        every stage of a run, f32 caches: the reference
//! ours count BUNDLE SAMPLER BLOCKS                whole blocks between markers of benches/headset/insn.c; bytes of each on stdout, JSON
//! ours grow BUNDLE THREADS SESSIONS GAZE WARM BLOCKS   times of whole blocks of sessions stepped together, ms as JSON; GAZE 1: three branches
//! ours serve BUNDLE IN THREADS SAMPLER [f32]      a worker; times are of projecting the conditioning, flow and decoder
//! ```

use glam::Vec3;
use std::sync::Arc;
use std::time::Instant;
use visavis::internals::kernels::{Kernels, KvDtype, Scheme};
use visavis::internals::quant::{Options, SMALL, quantise};
use visavis::internals::session::{Anchoring, Diagnostics, Probe};
use visavis::{BundleFile, Engine, Sampler, Session, SessionOptions};
use visavis_peers::Result;
use visavis_peers::worker::{Blocks, serve};
use visavis_tools::bench::Size;
use visavis_tools::trace::{TraceInput, trace};

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    match args[..] {
        ["config", size] => {
            let engine = size.parse::<Size>()?.engine(Scheme::I8, Kernels::detect()?)?;
            println!("{}", serde_json::to_string(engine.config())?);
            Ok(())
        }
        ["quantize", from, to, scheme] => {
            let options =
                Options { scheme: scheme.parse()?, smallest: SMALL, keep: &[], calibration: None, budget: None };
            Ok(std::fs::write(to, quantise(&BundleFile::open(from)?, &options)?.bytes)?)
        }
        ["trace", bundle, input, out] => {
            let engine = Engine::load(bundle)?;
            let input = TraceInput::read(input, &engine)?;
            Ok(trace(&engine, &input, plain(KvDtype::F32))?.write(out)?)
        }
        ["count", bundle, sampler, blocks] => count(bundle, sampler.parse()?, blocks.parse()?),
        ["grow", bundle, ref numbers @ ..] if numbers.len() == 5 => {
            let numbers = numbers.iter().map(|n| n.parse()).collect::<std::result::Result<Vec<usize>, _>>()?;
            grow(bundle, &numbers)
        }
        ["serve", bundle, input, threads, sampler, ref cache @ ..] => {
            let engine = Engine::load(bundle)?;
            let input = TraceInput::read(input, &engine)?;
            let cache = if cache.first() == Some(&"f32") { KvDtype::F32 } else { KvDtype::F16 };
            let options = SessionOptions { threads: threads.parse()?, sampler: sampler.parse()?, ..plain(cache) };
            let session = engine.session(options.clone())?;
            serve(&mut Ours { engine, options, input, session, stop: Stop::default() })
        }
        _ => {
            Err("usage: ours config SIZE | quantize IN OUT SCHEME | trace BUNDLE IN OUT | count BUNDLE SAMPLER BLOCKS \
              | grow BUNDLE THREADS SESSIONS GAZE WARM BLOCKS | serve BUNDLE IN THREADS SAMPLER [f32]"
                .into())
        }
    }
}

/// Runs whole blocks, two voices and pose included, each between two markers.
fn count(bundle: &str, sampler: Sampler, blocks: usize) -> Result<()> {
    let engine = Engine::load(bundle)?;
    let options = SessionOptions { sampler, diagnostics: Anchoring::Never.into(), ..SessionOptions::default() };
    let mut session = engine.session(options)?;
    let tone: Vec<f32> = (0..3200).map(|i| 0.2 * (0.04 * i as f32).sin()).collect();
    for _ in 0..blocks {
        let now = session.next_due();
        session.push_user_head(Vec3::new(1.5 * now.sin() as f32, 1.65, 1.5), now)?;
        session.push_agent_audio(&tone, 24_000)?;
        session.push_user_audio(&tone, 24_000)?;
        marker();
        session.poll(now)?;
        marker();
    }
    let config = engine.config();
    println!(
        "{}",
        serde_json::json!({
            "level": engine.kernels().level().to_string(), "sampler": sampler.to_string(), "idle_blocks": engine.idle_blocks(),
            "evaluations": sampler.evaluations(), "weight_bytes": engine.block_bytes(sampler), "flow": config.flow, "vae": config.vae,
        })
    );
    Ok(())
}

/// `numbers`: threads, sessions, whether there is a gaze target, blocks before any is timed, blocks
/// that are.
fn grow(bundle: &str, numbers: &[usize]) -> Result<()> {
    let [threads, sessions, gaze, warm, blocks] = numbers else { return Err("five numbers".into()) };
    let engine = Engine::load(bundle)?;
    let options = |seed| SessionOptions {
        seed,
        gaze: (*gaze > 0).then_some(0.5),
        diagnostics: Anchoring::Never.into(),
        ..SessionOptions::default()
    };
    let mut sessions = (0..*sessions as u64).map(|i| Ok(engine.session(options(i))?)).collect::<Result<Vec<_>>>()?;
    let mut team = engine.team(*threads)?;
    let mut times = Vec::with_capacity(*blocks);
    for block in 0..warm + blocks {
        let mut due = Vec::with_capacity(sessions.len());
        for session in &mut sessions {
            let now = session.next_due();
            session.push_user_head(Vec3::new(1.5 * now.sin() as f32, 1.65, 1.5), now)?;
            session.push_agent_audio(&[0.1; 3200], 24_000)?;
            session.push_user_audio(&[0.1; 3200], 24_000)?;
            due.push((session, now));
        }
        let started = Instant::now();
        team.step(&mut due)?;
        if block >= *warm {
            times.push(1000.0 * started.elapsed().as_secs_f64());
        }
    }
    println!("{}", serde_json::json!({ "ms": times }));
    Ok(())
}

/// HINT #62, which does nothing but that the counting plugin sees it.
fn marker() {
    #[cfg(target_arch = "aarch64")]
    // SAFETY: processors take hints that they do not know for NOP.
    unsafe {
        std::arch::asm!("hint #62");
    }
}

/// The networks alone: nothing after the decoder that peers do not have.
fn plain(cache: KvDtype) -> SessionOptions {
    SessionOptions {
        stance: false,
        guard: false,
        diagnostics: Diagnostics { cache, anchoring: Anchoring::Never, bridge: false, ..Diagnostics::default() },
        ..SessionOptions::default()
    }
}

struct Ours {
    engine: Arc<Engine>,
    options: SessionOptions,
    input: TraceInput,
    session: Session,
    stop: Stop,
}

/// Times from the end of the audio encoder to the end of the decoder.
#[derive(Default)]
struct Stop {
    from: Option<Instant>,
    ms: f64,
}

impl Probe for Stop {
    fn stage(&mut self, _block: u64, name: &'static str, _values: &[f32]) {
        match name {
            "agent_features" | "user_features" | "conditioning.user" => self.from = Some(Instant::now()),
            "decoded" => self.ms = self.from.take().map_or(f64::NAN, |from| 1000.0 * from.elapsed().as_secs_f64()),
            _ => {}
        }
    }
}

impl Blocks for Ours {
    fn check(&mut self) -> Result<(Vec<f32>, Vec<f32>)> {
        let mut stages = trace(&self.engine, &self.input, self.options.clone())?.stages;
        let mut take = |name: &str| stages.remove(name).map(|a| a.values).ok_or("a stage is missing");
        Ok((take("latents")?, take("decoded")?))
    }

    fn block(&mut self) -> Result<f64> {
        let now = self.session.next_due();
        let angle = 0.4 * now as f32;
        self.session.push_user_head(Vec3::new(1.5 * angle.sin(), 1.65, 1.5 * angle.cos()), now)?;
        self.session.push_agent_audio(&[0.0; 3200], 24_000)?;
        self.session.push_user_audio(&[0.0; 3200], 24_000)?;
        self.stop.from = Some(Instant::now());
        self.session.poll_with(now, Some(&mut self.stop))?;
        Ok(self.stop.ms)
    }
}
