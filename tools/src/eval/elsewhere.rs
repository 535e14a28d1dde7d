//! Rows of motion that something else made for the same windows.

use super::clip::Clip;
use super::keep::{file, folder};
use super::window::{WINDOW, Window};
use std::path::{Path, PathBuf};
use visavis::{Error, ErrorKind, Frame, Result, Rig};

/// Names of rows that are there, or that readers of kept motion give a meaning of their own.
const TAKEN: [&str; 5] = ["corpus", "Random", "NN", "VAE", "other"];

/// A row of motion in files, one a window, as [`super::EvalOptions::keep`] writes them.
#[derive(Debug)]
pub(super) struct Elsewhere {
    pub(super) name: String,
    clips: Vec<Clip>,
}

impl Elsewhere {
    /// Opens and checks the files of all windows; `made` names the rows that the evaluation makes.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a name that is taken or no file can have, and, naming the file,
    /// for a window without one and for one that is not of this window, not as long, not of these
    /// joints or not finite; [`ErrorKind::Io`] when it cannot be read.
    pub(super) fn open(
        (name, dir): &(String, PathBuf),
        made: &[String],
        windows: &[Window],
        clips: &[Clip],
        rig: &Rig,
    ) -> Result<Self> {
        check_name(name, made)?;
        if !dir.is_dir() {
            let message = format!("row {name}: there is no such folder; it should hold {} and on", file(0));
            return Err(bad(message).with_path(dir));
        }
        let beyond = dir.join(file(windows.len()));
        if beyond.exists() {
            let message = format!(
                "row {name}: only {} windows are measured, and this is one more; make the row for the same --windows",
                windows.len()
            );
            return Err(bad(message).with_path(beyond));
        }
        let open = |(i, window): (usize, &Window)| Self::window(name, &dir.join(file(i)), window, clips, rig);
        Ok(Self { name: name.clone(), clips: windows.iter().enumerate().map(open).collect::<Result<_>>()? })
    }

    fn window(name: &str, path: &Path, window: &Window, clips: &[Clip], rig: &Rig) -> Result<Clip> {
        let source = clips[window.clip].name();
        let here = format!("frames {} to {} of {source}", window.first, window.first + WINDOW);
        if !path.exists() {
            let message = format!("row {name}: no motion for this window; write one for {here}");
            return Err(bad(message).with_path(path));
        }
        let clip = Clip::open(path, rig)?;
        if clip.frames() != WINDOW {
            let message = format!("row {name}: {} frames; a window has {WINDOW}, {here}", clip.frames());
            return Err(bad(message).with_path(path));
        }
        let first = window.first.to_string();
        for (key, own) in [("clip", source.as_str()), ("first_frame", first.as_str())] {
            if let Some(said) = clip.note(key).filter(|said| *said != own) {
                let message = format!(
                    "row {name}: its {key} is {said}, but the window is {here}; make the row for these clips and \
                     --windows"
                );
                return Err(bad(message).with_path(path));
            }
        }
        clip.read(0, WINDOW)?;
        Ok(clip)
    }

    /// Its motion in window `number`.
    ///
    /// # Errors
    /// Those of [`Clip::read`].
    pub(super) fn motion(&self, number: usize) -> Result<Vec<Frame>> {
        Ok(self.clips[number].read(0, WINDOW)?.frames)
    }
}

/// A name must do for a folder on every file system, and not be another row's there.
fn check_name(name: &str, made: &[String]) -> Result<()> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if !name.starts_with(|c: char| c.is_ascii_alphanumeric())
        || !name.chars().all(plain)
        || name.len() > 64
        || name.ends_with('.')
    {
        let message = "is no name for a row: up to 64 letters, digits, hyphens, underscores and dots, a letter or \
                       digit first, no dot last";
        return Err(bad(format!("{name:?} {message}")));
    }
    let rows = TAKEN.iter().map(ToString::to_string).chain(made.iter().map(|row| folder(row)));
    match rows.into_iter().find(|row| row.eq_ignore_ascii_case(name)) {
        Some(row) => Err(bad(format!("a row is called {row} already; give the row {name} another name"))),
        None => Ok(()),
    }
}

fn bad(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::Argument, message)
}
