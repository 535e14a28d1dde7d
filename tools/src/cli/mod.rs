//! The command line: arguments, progress and reports around the library.
//!
//! Exit codes: 0 done, 1 an error (one line on stderr, `visavis: ...`), 2 wrong usage.

mod allocations;
mod args;
mod bench;
mod calibrate;
mod cold_start;
mod demo;
mod eval;
mod files;
mod generate;
mod inspect;
mod live;
mod locate;
mod progress;
mod quantize;
mod react;
mod report;
mod soak;
mod trace;
mod values;

use args::{Cli, Command, DemoArgs};
use clap::Parser;
use std::io::Write;
use std::process::ExitCode;
use visavis::{Error, ErrorKind, Result};

/// Parses the arguments, does what they ask for, and reports errors.
pub fn main() -> ExitCode {
    let done = match Cli::try_parse() {
        Ok(cli) => match cli.command.unwrap_or_else(|| Command::Demo(DemoArgs::default())) {
            Command::Demo(args) => demo::run(&args),
            Command::Generate(args) => generate::run(&args),
            Command::Inspect(args) => inspect::run(&args),
            Command::Quantize(args) => quantize::run(&args),
            Command::Report(args) => report::run(&args),
            Command::Bench(args) => bench::run(&args),
            Command::Eval(args) => eval::run(&args),
            Command::Calibrate(args) => calibrate::run(&args),
            Command::Soak(args) => soak::run(&args),
            Command::Locate(args) => locate::run(&args),
            Command::Trace(args) => trace::run(&args),
            Command::Live(args) => live::run(&args),
            Command::React(args) => react::run(&args),
        },
        Err(e) => return usage(&e),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            // Nobody is left to tell where stderr is closed.
            let _ = writeln!(std::io::stderr(), "visavis: {e}");
            ExitCode::from(1)
        }
    }
}

/// Help and version as clap prints them; mistakes in the style of every other error.
fn usage(e: &clap::Error) -> ExitCode {
    if !e.use_stderr() {
        let _ = e.print();
        return ExitCode::SUCCESS;
    }
    let text = e.to_string();
    let _ = write!(std::io::stderr(), "visavis: {}", text.strip_prefix("error: ").unwrap_or(&text));
    ExitCode::from(2)
}

/// Prints to stdout; a reader that has gone (`visavis inspect ... | head`) is no error.
fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::new(ErrorKind::Io, format!("cannot write to stdout: {e}")))
        }
        _ => Ok(()),
    }
}
