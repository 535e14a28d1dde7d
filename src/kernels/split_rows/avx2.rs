use super::scalar::body;

#[target_feature(enable = "avx2,fma,f16c")]
pub(super) fn run(x: &[f32], q: [&mut [i8]; 2], sums: [&mut [i32]; 2]) -> f32 {
    body(x, q, sums)
}
