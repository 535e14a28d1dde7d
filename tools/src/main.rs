//! The `visavis` command; see `visavis --help`. Everything it does is in the library.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
