use half::f16;

use super::MatmulF32F16;
use crate::kernels::matmul_f32_f32::tests::{assert_exact, for_jobs};
use crate::kernels::operation::Kernel;
use crate::kernels::testing::Results;

pub(super) fn cases(kernel: Kernel<MatmulF32F16>, results: &mut Results) {
    for_jobs(91, f16::from_f32, |job, tile| kernel.run(job, tile), results);
}

#[test]
fn products_of_small_integers_are_exact() {
    for kernel in Kernel::<MatmulF32F16>::all() {
        assert_exact(f16::from_f32, |job, tile| kernel.run(job, tile));
    }
}
