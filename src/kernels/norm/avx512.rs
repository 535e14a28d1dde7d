use super::scalar::body;

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn run(x: &[f32], shift: &[f32], scale: &[f32], y: &mut [f32]) {
    body(x, shift, scale, y);
}
