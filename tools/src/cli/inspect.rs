//! `visavis inspect`: what a bundle holds.

use super::args::InspectArgs;
use super::print;
use visavis::{BundleFile, Error, ErrorKind, Result};
use visavis_tools::contents::Contents;

pub fn run(args: &InspectArgs) -> Result<()> {
    let contents = Contents::of(&BundleFile::open(&args.file)?)?;
    if !args.json {
        return print(&contents.to_string());
    }
    let json = serde_json::to_string_pretty(&contents).map_err(|e| {
        Error::new(ErrorKind::BundleInvalid, format!("cannot be shown as JSON: {e}")).with_path(&args.file)
    })?;
    print(&(json + "\n"))
}
