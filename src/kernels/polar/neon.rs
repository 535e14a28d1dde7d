use super::scalar::body;

#[target_feature(enable = "neon")]
pub(super) fn run(m: &[[f32; 9]], out: &mut [[f32; 9]]) {
    body(m, out);
}
