//! `visavis demo`: the shipped model over the bundled sample conversation, which sounds may
//! interrupt.

use super::args::{DemoArgs, RunArgs};
use super::{files, generate};
use visavis::Result;
use visavis_tools::offline::OutputFolder;
use visavis_tools::room;

const TITLE: &str = "Visavis demo";

pub fn run(args: &DemoArgs) -> Result<()> {
    let out = OutputFolder::prepare(&args.out)?;
    if !args.sounds {
        let talk = files::conversation()?;
        return generate::generate(&args.run, &talk, TITLE, "A sample conversation with synthetic voices", out);
    }
    let model = files::room_model(args.run.model.as_deref())?;
    let run = RunArgs { model: Some(model), ..args.run.clone() };
    let talk = files::interrupted(room::interruptions())?;
    generate::generate(&run, &talk, TITLE, "A sample conversation that a dog, a crash and music interrupt", out)
}
