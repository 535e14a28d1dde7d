use super::scalar::body;

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn run(x: &mut [f32], cos: &[f32], sin: &[f32]) {
    body(x, cos, sin);
}
