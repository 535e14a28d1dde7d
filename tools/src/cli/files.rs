//! Where the files that come with the program are.

use std::path::{Path, PathBuf};
use visavis::{Engine, Error, ErrorKind, Result};
use visavis_tools::offline::{Conversation, Sound};
use visavis_tools::room;

/// The shipped bundle, which has hearing.
const ROOM_MODEL: &str = "models/visavis-room-i8.safetensors";

/// The shipped bundle of the kind mospa.
const CLIP_MODEL: &str = "models/visavis-mospa-i8.safetensors";

/// The bundle to use: `given`, else the shipped one.
pub fn model(given: Option<&Path>) -> Result<PathBuf> {
    given_or_shipped(given, ROOM_MODEL, "the model", "; or name a bundle with --model")
}

/// The bundle with hearing to use: `given`, else the shipped one.
pub fn room_model(given: Option<&Path>) -> Result<PathBuf> {
    let advice = "; or name a bundle with hearing by --model (`visavis inspect` tells)";
    given_or_shipped(given, ROOM_MODEL, "the model with hearing", advice)
}

/// The bundle of the kind mospa to use: `given`, else the shipped one.
pub fn clip_model(given: Option<&Path>) -> Result<PathBuf> {
    given_or_shipped(given, CLIP_MODEL, "the model of whole clips", "; or name a bundle of the kind mospa by --model")
}

/// `given`, else the file `relative` that comes with the program.
fn given_or_shipped(given: Option<&Path>, relative: &str, what: &str, advice: &str) -> Result<PathBuf> {
    let found = given.map_or_else(|| shipped(relative), |path| Ok(path.to_path_buf()));
    found.map_err(|tried| missing(what, &tried, advice))
}

/// Makes sure that sounds would be heard with the bundle at `model`.
pub fn hears(engine: &Engine, model: &Path) -> Result<()> {
    if engine.has_hearing() {
        return Ok(());
    }
    let message = format!(
        "{} has no hearing, so that sounds in the room mean nothing to it; take {ROOM_MODEL}, or another bundle with hearing \
         (`visavis inspect` tells)",
        engine.name()
    );
    Err(Error::new(ErrorKind::Argument, message).with_path(model))
}

/// A file of the sample conversation.
fn sample(name: &str) -> Result<PathBuf> {
    shipped(&format!("samples/{name}")).map_err(|tried| missing("the sample conversation", &tried, ""))
}

/// The sample conversation.
pub fn conversation() -> Result<Conversation> {
    interrupted(Vec::new())
}

/// The sample conversation, as bundles are quantised for and judged by: those that hear sounds in
/// the room hear some.
pub fn judged() -> Result<Conversation> {
    interrupted(room::around())
}

/// The sample conversation with sounds in the room.
pub fn interrupted(sounds: Vec<Sound>) -> Result<Conversation> {
    let [agent, user, path] = ["agent.wav", "user.wav", "user.csv"].map(sample);
    Conversation::read_with(Some(&agent?), Some(&user?), Some(&path?), sounds, None)
}

/// An error if both names stand for one file: a mapped bundle must not be written to.
pub fn apart(input: &Path, output: &Path) -> Result<()> {
    if input.canonicalize().ok().zip(output.canonicalize().ok()).is_none_or(|(a, b)| a != b) {
        return Ok(());
    }
    let message = "the result would take the place of the bundle it is made from; give another name";
    Err(Error::new(ErrorKind::Argument, message).with_path(output))
}

/// Looks for `relative` in the current folder, beside the program, and where the program was built;
/// else what was tried.
fn shipped(relative: &str) -> Result<PathBuf, Vec<PathBuf>> {
    let beside = std::env::current_exe().ok().and_then(|exe| Some(exe.parent()?.join(relative)));
    let built = Path::new(env!("CARGO_MANIFEST_DIR")).parent().map(|repository| repository.join(relative));
    let tried = [Some(PathBuf::from(relative)), beside, built];
    let tried: Vec<_> = tried.into_iter().flatten().collect();
    tried.iter().find(|path| path.exists()).cloned().ok_or(tried)
}

fn missing(what: &str, tried: &[PathBuf], advice: &str) -> Error {
    let list: Vec<_> = tried.iter().map(|path| path.display().to_string()).collect();
    let message = format!(
        "{what} is not there (tried {}); run visavis in its repository, or copy the file there{advice}",
        list.join(", ")
    );
    Error::new(ErrorKind::Io, message)
}
