use super::scalar::body;

#[target_feature(enable = "neon")]
pub(super) fn run(x: &[f32], shift: &[f32], scale: &[f32], y: &mut [f32]) {
    body(x, shift, scale, y);
}
