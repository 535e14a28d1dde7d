//! A look at every stage of a block.

use crate::frame::Frame;

/// Receives what the stages of a block compute, in the order of the data flow.
///
/// | stage | shape |
/// |---|---|
/// | `agent_features`, `user_features` | `[4, audio features]`, absent voices left out |
/// | `conditioning.user` | `[8]` metres in the agent's frame, left out while unknown |
/// | `conditioning.sound` | `[S]`, left out before the first sound |
/// | `conditioning.activity` | `[3]`, left out where the body is not at rest |
/// | `hearing.ears` | `[2, 3200]` pascals at the left and the right ear in the block before, likewise |
/// | `hearing.features` | `[4, hearing features]`, likewise |
/// | `x1` | `[branches, latent]`, once per evaluation |
/// | `latents` | `[latent]`, standardised |
/// | `decoded` | `[4, features]`, standardised, left out where the latent was not usable |
/// | `user_rows`, `m`, `d`, `delta`, `poses` | `[12]`, `[D]`, once per frame (kind `dram`) |
/// | `roots` | `[4, 3]`: x, z, yaw |
/// | `positions` | `[4, joints, 3]` |
/// | `rotations` | `[4, joints, 4]` (x, y, z, w) |
/// | `dyadic` | `[4, joints]` (kind `dram`) |
pub trait Probe {
    /// One stage of block `block`.
    fn stage(&mut self, block: u64, name: &'static str, values: &[f32]);
}

/// Passes a stage on if there is someone to receive it.
pub(super) fn tell(probe: &mut Option<&mut dyn Probe>, block: u64, name: &'static str, values: &[f32]) {
    if let Some(probe) = probe {
        probe.stage(block, name, values);
    }
}

impl dyn Probe + '_ {
    /// Frames as flat arrays; allocates, and only when somebody listens.
    pub(super) fn frames(&mut self, block: u64, frames: &[Frame]) {
        let roots = frames.iter().flat_map(|f| [f.root.x as f32, f.root.z as f32, f.root.yaw as f32]);
        self.stage(block, "roots", &roots.collect::<Vec<f32>>());
        let joints = || frames.iter().flat_map(|f| &f.global);
        self.stage(block, "positions", &joints().flat_map(|t| t.position.to_array()).collect::<Vec<f32>>());
        self.stage(block, "rotations", &joints().flat_map(|t| t.rotation.to_array()).collect::<Vec<f32>>());
    }
}
