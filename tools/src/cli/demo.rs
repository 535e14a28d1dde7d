//! `visavis demo`: the shipped model over the bundled sample conversation.

use super::args::DemoArgs;
use super::{files, generate};
use visavis::Result;
use visavis_tools::offline::OutputFolder;

pub fn run(args: &DemoArgs) -> Result<()> {
    let out = OutputFolder::prepare(&args.out)?;
    let talk = files::conversation()?;
    generate::generate(&args.run, &talk, "Visavis demo", "A sample conversation with synthetic voices", out)
}
