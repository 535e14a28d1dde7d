//! `visavis demo`: the shipped model over the bundled sample conversation.

use super::args::DemoArgs;
use super::{files, generate};
use visavis::error::Result;
use visavis::offline::{Conversation, OutputFolder};

pub fn run(args: &DemoArgs) -> Result<()> {
    let out = OutputFolder::prepare(&args.out)?;
    let [agent, user, path] = ["agent.wav", "user.wav", "user.csv"].map(files::sample);
    let (agent, user, path) = (agent?, user?, path?);
    let talk = Conversation::read(Some(&agent), Some(&user), Some(&path))?;
    generate::generate(&args.run, &talk, "Visavis demo", "A sample conversation with synthetic voices", out)
}
