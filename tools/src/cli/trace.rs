//! `visavis trace`: every stage of a run, for comparison with another implementation.

use super::args::TraceArgs;
use super::print;
use std::fmt::Write;
use visavis::internals::kernels::KvDtype;
use visavis::internals::session::{Anchoring, Diagnostics};
use visavis::{Engine, Result, SessionOptions};
use visavis_tools::trace::{TraceInput, trace};

pub fn run(args: &TraceArgs) -> Result<()> {
    let engine = Engine::load(&args.model)?;
    let input = TraceInput::read(&args.input, &engine)?;
    let options = SessionOptions {
        seed: args.seed,
        sampler: args.sampler,
        guidance: args.weights.guidance,
        gaze_guidance: args.weights.gaze_guidance,
        stance: false,
        guard: false,
        diagnostics: Diagnostics {
            cache: KvDtype::F32,
            anchoring: Anchoring::Never,
            bridge: false,
            ..Diagnostics::default()
        },
        ..SessionOptions::default()
    };
    let trace = trace(&engine, &input, options)?;
    trace.write(&args.out)?;
    let mut text = format!("{} blocks into {}\n", input.blocks, args.out.display());
    for (name, array) in trace.stages.iter().filter(|(name, _)| !name.starts_with("x1.") || *name == "x1.0") {
        // Writing to a string does not fail.
        let _ = writeln!(text, "  {name:<20} {:?}", array.shape);
    }
    print(&text)
}
