//! The motion of rows as files, for whoever wants to look at it, judge it otherwise, or make other
//! motion for the same windows.
//!
//! `DIR/ROW/000.safetensors` is the motion of row ROW in the first window, a clip of 400 frames in
//! the format of [`Clip`], in the space of the clip that the window is of, joints on the rig. ROW
//! is the row's name with `-` for a colon (`euler:8`: `euler-8`). Beside the tensors each file says
//!
//! | key | what |
//! |---|---|
//! | `clip`, `first_frame` | the clip's file, and the frame of it that is the file's first |
//! | `window`, `row`, `model`, `fps` | the window's number, the row, the bundle's name, 30 |
//!
//! The corpus' files hold what is heard and seen in the window too, the others only the user's
//! place. Sessions begin [`LEAD`](super::LEAD) frames before `first_frame`.

use super::clip::Clip;
use super::window::Window;
use crate::export::write_atomically;
use safetensors::Dtype;
use serde_json::{Map, json};
use std::path::{Path, PathBuf};
use visavis::{Error, ErrorKind, Frame, Result};

/// Where rows are kept.
#[derive(Debug)]
pub(super) struct Keep<'a> {
    dir: &'a Path,
    clips: &'a [Clip],
    model: &'a str,
}

/// The folder of a row.
pub(super) fn folder(row: &str) -> String {
    row.replace(':', "-")
}

/// The file of a window.
pub(super) fn file(number: usize) -> String {
    format!("{number:03}.safetensors")
}

impl<'a> Keep<'a> {
    /// Keeps rows in `dir`, which is made if it is missing.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] if it cannot be made or read, [`ErrorKind::Argument`] if it holds
    /// anything: windows of two runs must not mix.
    pub(super) fn new(dir: &'a Path, clips: &'a [Clip], model: &'a str) -> Result<Self> {
        let io = |e| Error::io("make the folder for kept motion", dir, e);
        std::fs::create_dir_all(dir).map_err(io)?;
        if std::fs::read_dir(dir).map_err(io)?.next().is_some() {
            let message = "there is something in this folder already; empty it, or keep motion in another";
            return Err(Error::new(ErrorKind::Argument, message).with_path(dir));
        }
        Ok(Self { dir, clips, model })
    }

    /// Writes the motion of a row in window `number`; `senses`: with voices and the turn of the
    /// user's head.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] naming the file.
    pub(super) fn write(
        &self,
        row: &str,
        number: usize,
        window: &Window,
        frames: &[Frame],
        senses: bool,
    ) -> Result<()> {
        let dir = self.row(row);
        std::fs::create_dir_all(&dir).map_err(|e| Error::io("make the folder for kept motion", &dir, e))?;
        let notes = json!({
            "clip": self.clips[window.clip].name(),
            "first_frame": window.first.to_string(),
            "fps": visavis::FPS.to_string(),
            "model": self.model,
            "row": row,
            "window": number.to_string(),
        });
        let bytes = bytes(notes, &tensors(window, frames, senses))?;
        write_atomically(dir.join(file(number)), |w| w.write_all(&bytes))
    }

    /// Takes back a row that has no motion in some window.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] naming its folder.
    pub(super) fn forget(&self, row: &str) -> Result<()> {
        let dir = self.row(row);
        match std::fs::remove_dir_all(&dir) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io("remove the folder", &dir, e)),
            _ => Ok(()),
        }
    }

    fn row(&self, row: &str) -> PathBuf {
        self.dir.join(folder(row))
    }
}

type Tensor = (&'static str, Dtype, Vec<usize>, Vec<u8>);

/// The tensors of a clip, by name.
fn tensors(window: &Window, frames: &[Frame], senses: bool) -> Vec<Tensor> {
    let joints = frames.first().map_or(0, |frame| frame.global.len());
    let (count, truth) = (frames.len(), &window.truth);
    let floats = |values: &mut dyn Iterator<Item = f32>| values.flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    let global = || frames.iter().flat_map(|frame| &frame.global);
    let positions = floats(&mut global().flat_map(|joint| joint.position.to_array()));
    let rotations = floats(&mut global().flat_map(|joint| joint.rotation.to_array()));
    let user = floats(&mut truth.user.iter().flat_map(|place| place.to_array()));
    let mut all = vec![
        ("positions", Dtype::F32, vec![count, joints, 3], positions),
        ("rotations", Dtype::F32, vec![count, joints, 4], rotations),
        ("user_head", Dtype::F32, vec![truth.user.len(), 3], user),
    ];
    if senses {
        if let Some(turns) = &truth.user_rotation {
            let bytes = floats(&mut turns.iter().flat_map(|turn| turn.to_array()));
            all.push(("user_head_rotation", Dtype::F32, vec![turns.len(), 4], bytes));
        }
        for (name, voice) in [("agent_voice", &truth.agent_voice), ("user_voice", &truth.user_voice)] {
            if let Some(voice) = voice {
                let bytes = voice.iter().flat_map(|sample| sample.to_le_bytes()).collect();
                all.push((name, Dtype::I16, vec![voice.len()], bytes));
            }
        }
    }
    all.sort_by_key(|tensor| tensor.0);
    all
}

/// A safetensors file. The crate's own writer orders notes at random, and the same motion should be
/// the same file.
fn bytes(notes: serde_json::Value, tensors: &[Tensor]) -> Result<Vec<u8>> {
    let mut header = Map::from_iter([("__metadata__".to_owned(), notes)]);
    let mut at = 0;
    for (name, dtype, shape, data) in tensors {
        let info = json!({ "dtype": dtype, "shape": shape, "data_offsets": [at, at + data.len()] });
        header.insert((*name).to_owned(), info);
        at += data.len();
    }
    let failed = |e: serde_json::Error| Error::new(ErrorKind::State, format!("cannot write a header: {e}"));
    let mut header = serde_json::to_vec(&header).map_err(failed)?;
    header.resize(header.len().next_multiple_of(8), b' ');
    let mut out = (header.len() as u64).to_le_bytes().to_vec();
    out.extend(header);
    tensors.iter().for_each(|(.., data)| out.extend(data));
    Ok(out)
}

#[cfg(test)]
#[path = "keep_tests.rs"]
mod tests;
