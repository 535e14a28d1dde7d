//! What measurements and checks of the maths change about a session; hosts leave it alone.

use super::{GazeControl, argument};
use crate::audio::AudioBackend;
use crate::config::{ACTIVITY, CleanHistory};
use crate::error::Result;
use crate::kernels::KvDtype;

/// Largest [`Diagnostics::first_block`].
const MAX_FIRST_BLOCK: u64 = 70_000_000;

/// When recent motion is encoded anew.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Anchoring {
    /// As the bundle says.
    #[default]
    Bundle,
    /// Never.
    Never,
    /// Every this many blocks (at least 1).
    Every(u32),
}

/// Flow time at which finished blocks enter the reference network (the single-step student brings
/// its own).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum HistoryTime {
    /// As the bundle says.
    #[default]
    Bundle,
    /// At each evaluation's own flow time.
    Imputed,
    /// Nearly clean in late evaluations.
    Clean(CleanHistory),
}

/// Options that measurements and tests need and conversations do not.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnostics {
    /// What the gaze target, or its absence, means to the network.
    pub gaze_control: GazeControl,
    /// What the network is told at rest instead of the activity that is drawn, of a bundle that is
    /// told of it.
    pub activity: Option<[f32; ACTIVITY]>,
    /// Flow time at which history enters the reference network.
    pub history: HistoryTime,
    /// Storage of the key-value caches; f16 but for checks of the maths.
    pub cache: KvDtype,
    /// When recent motion is encoded anew.
    pub anchoring: Anchoring,
    /// Whether borders between blocks are bridged, so that motion goes on as it was going.
    pub bridge: bool,
    /// Number of the first block, at most 70 million (108 days): the session's time starts at `4
    /// first_block / 30` s, and everything that counts goes on from there.
    pub first_block: u64,
    /// What runs the audio encoder.
    pub audio: AudioBackend,
}

impl Default for Diagnostics {
    fn default() -> Self {
        Self {
            gaze_control: GazeControl::Calibrated,
            activity: None,
            history: HistoryTime::Bundle,
            cache: KvDtype::F16,
            anchoring: Anchoring::Bundle,
            bridge: true,
            first_block: 0,
            audio: AudioBackend::default(),
        }
    }
}

impl From<Anchoring> for Diagnostics {
    fn from(anchoring: Anchoring) -> Self {
        Self { anchoring, ..Self::default() }
    }
}

impl Diagnostics {
    pub(super) fn check(&self) -> Result<()> {
        if let HistoryTime::Clean(c) = self.history
            && ![c.tau, c.from].iter().all(|t| (0.0..=1.0).contains(t))
        {
            return Err(argument(format!("clean history at {} from {}: both are flow times, 0 to 1", c.tau, c.from)));
        }
        if self.anchoring == Anchoring::Every(0) {
            return Err(argument("anchoring every 0 blocks: use Anchoring::Never"));
        }
        if self.first_block > MAX_FIRST_BLOCK {
            return Err(argument(format!("first block {}: at most {MAX_FIRST_BLOCK}", self.first_block)));
        }
        Ok(())
    }
}
