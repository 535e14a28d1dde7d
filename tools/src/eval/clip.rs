//! Clips of recorded conversation, in the format that training uses.
//!
//! One safetensors file per clip (`training/visavis_train/corpus/store.py`):
//!
//! | tensor | shape | what |
//! |---|---|---|
//! | `positions` | f32 `[T, J, 3]` | joint positions, metres, Y up, joints in the rig's order |
//! | `rotations` | f32 `[T, J, 4]` | joint rotations in the world, `(x, y, z, w)` |
//! | `user_head` | f32 `[T, 3]` | the user's head, metres |
//! | `user_head_rotation` | f32 `[T, 4]` | its rotation in the world, `(x, y, z, w)`; left out where not recorded |
//! | `agent_voice`, `user_voice` | i16 `[800 T]` | 24 kHz mono; left out where absent |

use crate::recording::Recording;
use glam::{Quat, Vec3};
use safetensors::{Dtype, tensor::Metadata};
use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use visavis::internals::frame::FRAME_SAMPLES;
use visavis::internals::pose::root_of;
use visavis::{Error, ErrorKind, FPS, Frame, Result, Rig, Root, Transform};

/// Longest header that is read, bytes.
const MAX_HEADER: u64 = 1 << 20;

/// A clip, on disk or in memory. Of a file the header has been read and checked; its data is read
/// in parts.
#[derive(Debug, Clone)]
pub struct Clip {
    path: PathBuf,
    frames: usize,
    notes: HashMap<String, String>,
    data: Data,
}

#[derive(Debug, Clone)]
enum Data {
    File {
        joints: usize,
        /// Offsets in the file of [`TENSORS`].
        at: [Option<u64>; 6],
    },
    Memory(Arc<Segment>),
}

const TENSORS: [&str; 6] = ["positions", "rotations", "user_head", "agent_voice", "user_voice", "user_head_rotation"];

/// Some seconds of a clip.
#[derive(Debug, Clone)]
pub struct Segment {
    /// Frames, numbered from 0: `root` and `global` are filled, the fixed-bone-length rig is not.
    pub frames: Vec<Frame>,
    /// The user's head at each frame, metres.
    pub user: Vec<Vec3>,
    /// Its rotation; `None` where that was not recorded.
    pub user_rotation: Option<Vec<Quat>>,
    /// The agent's voice, 24 kHz mono, 800 samples per frame; `None` where absent.
    pub agent_voice: Option<Vec<i16>>,
    /// The user's voice, likewise.
    pub user_voice: Option<Vec<i16>>,
}

impl Clip {
    /// Opens a clip whose bodies have the joints of `rig`.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] when it cannot be read, [`ErrorKind::Argument`] when it is not a clip,
    /// each naming the file.
    pub fn open(path: impl AsRef<Path>, rig: &Rig) -> Result<Self> {
        let path = path.as_ref();
        let mut header = Vec::new();
        let io = |e| Error::io("read the clip", path, e);
        let mut file = File::open(path).map_err(io)?;
        let mut length = [0; 8];
        file.read_exact(&mut length).map_err(io)?;
        let length = u64::from_le_bytes(length);
        if length > MAX_HEADER {
            return Err(bad("it does not begin as a safetensors file does").with_path(path));
        }
        file.take(length).read_to_end(&mut header).map_err(io)?;
        let size = std::fs::metadata(path).map_err(io)?.len();
        Self::parse(&header, size, path, rig).map_err(|e| e.with_path(path))
    }

    fn parse(header: &[u8], size: u64, path: &Path, rig: &Rig) -> Result<Self> {
        let metadata: Metadata = serde_json::from_slice(header)
            .map_err(|e| bad(format!("its safetensors header is damaged ({e}); write it again")))?;
        let start = 8 + header.len() as u64;
        let joints = rig.len();
        let Some(&[frames, _, _]) = metadata.info("positions").map(|info| info.shape.as_slice()) else {
            return Err(bad("it has no tensor positions [T, J, 3]; see visavis::eval::Clip for the format"));
        };
        let shapes = [
            vec![frames, joints, 3],
            vec![frames, joints, 4],
            vec![frames, 3],
            vec![800 * frames],
            vec![800 * frames],
            vec![frames, 4],
        ];
        let mut at = [None; 6];
        for (i, (name, shape)) in TENSORS.iter().zip(shapes).enumerate() {
            let (dtype, width) = if i < 3 || i == 5 { (Dtype::F32, 4) } else { (Dtype::I16, 2) };
            match metadata.info(name) {
                Some(info) if info.dtype == dtype && info.shape == shape => {
                    let offset = start + info.data_offsets.0 as u64;
                    if offset + (width * shape.iter().product::<usize>()) as u64 > size {
                        return Err(bad(format!("it ends within the tensor {name}; copy it again")));
                    }
                    at[i] = Some(offset);
                }
                Some(info) => {
                    let (has, is) = (&info.shape, info.dtype);
                    return Err(bad(format!(
                        "its tensor {name} is {is:?} {has:?}, not {dtype:?} {shape:?}: {frames} frames, {joints} joints"
                    )));
                }
                None if i < 3 => return Err(bad(format!("it has no tensor {name} {shape:?}"))),
                None => {}
            }
        }
        let notes = metadata.metadata().clone().unwrap_or_default();
        Ok(Self { path: path.to_path_buf(), frames, notes, data: Data::File { joints, at } })
    }

    /// The clips of a folder (its `.safetensors` files, by name), or the one file that `path` is.
    ///
    /// # Errors
    /// As [`Clip::open`]; [`ErrorKind::Argument`] for a folder without clips.
    pub fn list(path: impl AsRef<Path>, rig: &Rig) -> Result<Vec<Self>> {
        let path = path.as_ref();
        if !path.is_dir() {
            return Ok(vec![Self::open(path, rig)?]);
        }
        let io = |e| Error::io("list the clips", path, e);
        let mut files = Vec::new();
        for entry in std::fs::read_dir(path).map_err(io)? {
            let file = entry.map_err(io)?.path();
            if file.extension().is_some_and(|e| e == "safetensors") {
                files.push(file);
            }
        }
        files.sort();
        if files.is_empty() {
            return Err(bad("there are no clips (.safetensors) in this folder").with_path(path));
        }
        files.iter().map(|file| Self::open(file, rig)).collect()
    }

    /// A clip in memory.
    pub fn from_segment(name: &str, segment: Segment) -> Self {
        let (frames, data) = (segment.frames.len(), Data::Memory(Arc::new(segment)));
        Self { path: name.into(), frames, notes: HashMap::new(), data }
    }

    /// Its file, or its name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its name, without the folder that it lies in.
    pub fn name(&self) -> String {
        self.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }

    /// What its file says of `key` beside the tensors.
    pub fn note(&self, key: &str) -> Option<&str> {
        self.notes.get(key).map(String::as_str)
    }

    /// Its length, frames.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Reads `count` frames from frame `from` on.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] when they cannot be read, [`ErrorKind::Argument`] when they are outside
    /// the clip or hold numbers that are not finite, each naming the file.
    pub fn read(&self, from: usize, count: usize) -> Result<Segment> {
        if from + count > self.frames {
            let message = format!("frames {from} to {} of a clip of {}", from + count, self.frames);
            return Err(bad(message).with_path(&self.path));
        }
        match &self.data {
            Data::File { joints, at } => self.segment(*joints, at, from, count).map_err(|e| e.with_path(&self.path)),
            Data::Memory(all) => Ok(all.cut(from, from + count)),
        }
    }

    fn segment(&self, joints: usize, at: &[Option<u64>; 6], from: usize, count: usize) -> Result<Segment> {
        let io = |e| Error::io("read the clip", &self.path, e);
        let mut file = File::open(&self.path).map_err(io)?;
        let mut bytes = |tensor: usize, a_frame: usize| -> Result<Option<Vec<u8>>> {
            let Some(at) = at[tensor] else { return Ok(None) };
            let mut bytes = vec![0; count * a_frame];
            file.seek(SeekFrom::Start(at + (from * a_frame) as u64)).map_err(io)?;
            file.read_exact(&mut bytes).map_err(io)?;
            Ok(Some(bytes))
        };
        let floats = |bytes: Option<Vec<u8>>| -> Result<Vec<f32>> {
            let bytes = bytes.unwrap_or_default();
            let values: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
            match values.iter().all(|v| v.is_finite()) {
                true => Ok(values),
                false => Err(bad("it holds numbers that are not finite; write it again without them")),
            }
        };
        let samples = |bytes: Option<Vec<u8>>| {
            bytes.map(|bytes| bytes.as_chunks::<2>().0.iter().map(|b| i16::from_le_bytes(*b)).collect())
        };
        let positions = floats(bytes(0, 12 * joints)?)?;
        let rotations = floats(bytes(1, 16 * joints)?)?;
        let user = floats(bytes(2, 12)?)?;
        let (agent_voice, user_voice) = (samples(bytes(3, 1600)?), samples(bytes(4, 1600)?));
        let turned = bytes(5, 16)?.map(|bytes| floats(Some(bytes))).transpose()?;
        let user_rotation = turned.map(|numbers| numbers.chunks_exact(4).map(rotation).collect());

        let mut frames = Vec::with_capacity(count);
        let mut yaw = 0.0;
        for (i, (p, r)) in positions.chunks_exact(3 * joints).zip(rotations.chunks_exact(4 * joints)).enumerate() {
            let pairs = p.chunks_exact(3).zip(r.chunks_exact(4));
            let global: Vec<_> =
                pairs.map(|(p, r)| Transform { position: Vec3::from_slice(p), rotation: rotation(r) }).collect();
            let root = root_of(&global[0], yaw);
            yaw = root.yaw;
            let (index, time, hips) = (i as u64, i as f64 / f64::from(FPS), global[0].position);
            frames.push(Frame { index, time, root, hips, global, ..Frame::empty(joints) });
        }
        let user = user.chunks_exact(3).map(Vec3::from_slice).collect();
        Ok(Segment { frames, user, user_rotation, agent_voice, user_voice })
    }
}

impl Segment {
    /// Frames `from` to `to`, renumbered from 0, with what is heard and seen in them.
    #[must_use]
    pub fn cut(&self, from: usize, to: usize) -> Self {
        let voice = |v: &Option<Vec<i16>>| v.as_ref().map(|v| v[from * FRAME_SAMPLES..to * FRAME_SAMPLES].to_vec());
        let mut frames = self.frames[from..to].to_vec();
        frames.iter_mut().enumerate().for_each(|(i, f)| {
            (f.index, f.time) = (i as u64, i as f64 / f64::from(FPS));
        });
        let (agent_voice, user_voice) = (voice(&self.agent_voice), voice(&self.user_voice));
        let user_rotation = self.user_rotation.as_ref().map(|all| all[from..to].to_vec());
        Self { frames, user: self.user[from..to].to_vec(), user_rotation, agent_voice, user_voice }
    }

    /// The motion `frames`, which may be another than its own, with what was heard and seen here.
    pub fn recording(&self, rig: &Rig, frames: Vec<Frame>) -> Recording {
        let user = frames.iter().zip(&self.user).map(|(_, u)| Some(*u)).collect();
        Recording {
            rig: rig.clone(),
            frames,
            user,
            agent_voice: self.agent(),
            user_voice: self.user(),
            gaze_target: None,
            sounds: None,
        }
    }

    /// The agent's voice, full scale 1.
    pub fn agent(&self) -> Option<Vec<f32>> {
        self.agent_voice.as_deref().map(unit)
    }

    /// The user's voice, full scale 1.
    pub fn user(&self) -> Option<Vec<f32>> {
        self.user_voice.as_deref().map(unit)
    }

    /// The same frames moved and turned on the floor so that the first one's root is `root`.
    #[must_use]
    pub fn moved(&self, root: &Root) -> Vec<Frame> {
        let mut frames = self.frames.clone();
        let Some(from) = frames.first().map(|f| f.root) else { return frames };
        let turn = Quat::from_rotation_y((root.yaw - from.yaw) as f32);
        for frame in &mut frames {
            for joint in &mut frame.global {
                joint.position = root.to_world(from.to_local(joint.position));
                joint.rotation = turn * joint.rotation;
            }
            frame.hips = frame.global[0].position;
            frame.root = root_of(&frame.global[0], frame.root.yaw + root.yaw - from.yaw);
        }
        frames
    }
}

fn unit(samples: &[i16]) -> Vec<f32> {
    samples.iter().map(|&s| f32::from(s) / 32768.0).collect()
}

fn bad(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::Argument, message)
}

/// A rotation also for four numbers that are none.
fn rotation(numbers: &[f32]) -> Quat {
    let q = Quat::from_slice(numbers);
    if q.length_squared() > 1e-12 { q.normalize() } else { Quat::IDENTITY }
}

#[cfg(test)]
#[path = "clip_tests.rs"]
mod tests;
