use super::scalar::body;

#[target_feature(enable = "avx2,fma,f16c")]
pub(super) fn run(m: &[[f32; 9]], out: &mut [[f32; 9]]) {
    body(m, out);
}
