//! Kernels on the shapes of the real networks, for every CPU level available here.
//!
//! `cargo bench --bench kernels` (add `-- linear` and so on to choose). `pass` walks the matrices
//! of a whole network, more than the caches hold, so its bytes per second are read from memory;
//! `linear` repeats one matrix, which a large cache may hold.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use half::f16;
use visavis::internals::kernels::{
    Epilogue, Exec, I4_GROUP, Kernels, KvCache, KvDtype, Matrix, RowTable, Span, WeightData, Weights,
};

const SCHEMES: [&str; 4] = ["f32", "f16", "i8", "i4"];

/// (name, out, in, layers) of one network's products.
const PAPER_FLOW: [(&str, usize, usize); 4] =
    [("qkv", 3072, 1024), ("proj", 1024, 1024), ("fc1", 4096, 1024), ("fc2", 1024, 4096)];
const PAPER_DECODER: [(&str, usize, usize); 4] =
    [("qkv", 768, 256), ("proj", 256, 256), ("fc1", 1024, 256), ("fc2", 256, 1024)];
const BASE_FLOW: [(&str, usize, usize); 4] =
    [("qkv", 1152, 384), ("proj", 384, 384), ("fc1", 1536, 384), ("fc2", 384, 1536)];

fn matrix(kernels: &Kernels, scheme: &str, rows: usize, cols: usize) -> Matrix {
    let noise = |i: usize| ((i.wrapping_mul(2_654_435_761) >> 7) & 255) as u8;
    let n = rows * cols;
    let f32: Vec<f32> = (0..n).map(|i| f32::from(noise(i)) * 1e-3 - 0.128).collect();
    let (i8, scale): (Vec<i8>, _) = ((0..n).map(|i| noise(i) as i8).collect(), vec![1e-3; rows]);
    let (i4, group_scale): (Vec<u8>, _) = ((0..n / 2).map(noise).collect(), vec![f16::from_f32(0.01); n / I4_GROUP]);
    let f16: Vec<f16> = f32.iter().map(|&v| f16::from_f32(v)).collect();
    let data = match scheme {
        "f32" => WeightData::F32(&f32),
        "f16" => WeightData::F16(&f16),
        "i8" => WeightData::I8 { q: &i8, scale: &scale },
        _ => WeightData::I4 { q: &i4, scale: &group_scale },
    };
    kernels.pack(Weights { rows, cols, data }, None)
}

fn levels() -> Vec<Kernels> {
    Kernels::available().into_iter().filter_map(|l| Kernels::with_level(l).ok()).collect()
}

fn exec(kernels: Kernels, threads: usize) -> Exec {
    let mut exec = Exec::new(kernels, threads, 4096).expect("a thread");
    exec.begin();
    exec
}

fn linear(c: &mut Criterion) {
    for scheme in SCHEMES {
        for (name, out, cols) in [PAPER_FLOW[0], PAPER_FLOW[3], PAPER_DECODER[2], BASE_FLOW[2]] {
            let mut group = c.benchmark_group(format!("linear/{scheme}/{name}_{out}x{cols}"));
            for kernels in levels() {
                let w = matrix(&kernels, scheme, out, cols);
                group.throughput(Throughput::Bytes(w.bytes() as u64));
                for rows in [1, 2, 4, 5, 16] {
                    let (x, mut y) = (vec![0.5; rows * cols], vec![0.0; rows * out]);
                    let mut exec = exec(kernels, 1);
                    group.bench_function(BenchmarkId::new(kernels.level().name(), rows), |b| {
                        b.iter(|| exec.linear(&w, black_box(&x), rows, &mut y, Epilogue::Store));
                    });
                }
            }
        }
    }
}

/// One evaluation of a flow network: 4 layers of paper size, 8 of base size.
fn pass(c: &mut Criterion) {
    for (size, layers, shapes) in [("paper", 4, PAPER_FLOW), ("base", 8, BASE_FLOW)] {
        for scheme in SCHEMES {
            let mut group = c.benchmark_group(format!("pass/{size}/{scheme}"));
            for kernels in levels() {
                let weights: Vec<Matrix> = (0..layers)
                    .flat_map(|_| shapes.map(|(_, out, cols)| matrix(&kernels, scheme, out, cols)))
                    .collect();
                group.throughput(Throughput::Bytes(weights.iter().map(Matrix::bytes).sum::<usize>() as u64));
                for (threads, rows) in [(1, 4), (2, 4), (2, 1), (2, 6), (2, 16)] {
                    let (x, mut y) = (vec![0.5; rows * 4096], vec![0.0; rows * 4096]);
                    let mut exec = exec(kernels, threads);
                    let id = BenchmarkId::new(kernels.level().name(), format!("{threads}_threads_{rows}_rows"));
                    group.bench_function(id, |b| {
                        b.iter(|| {
                            for w in &weights {
                                let (x, y) = (&x[..rows * w.in_features()], &mut y[..rows * w.out_features()]);
                                exec.linear(w, black_box(x), rows, y, Epilogue::Store);
                            }
                        });
                    });
                }
            }
        }
    }
}

fn attend(c: &mut Criterion) {
    for (size, dim, len) in [("flow_paper", 1024, 100), ("decoder_paper", 256, 160), ("flow_base", 384, 32)] {
        for dtype in [KvDtype::F16, KvDtype::F32] {
            let mut cache = KvCache::new(2, len, 4, dim, dtype);
            let row = vec![0.3; dim];
            for position in 0..len as u64 {
                cache.write(0, position, &row, &row);
                cache.write(1, position, &row, &row);
            }
            let mut group = c.benchmark_group(format!("attend/{size}_{dim}x{len}/{dtype:?}"));
            for kernels in levels() {
                for threads in [1, 2] {
                    let mut exec = exec(kernels, threads);
                    let spans = [0, 0, 1, 1].map(|ring| Span { ring, first: 7, len: len as u32 });
                    let (q, mut y) = (vec![0.1; 4 * 3 * dim], vec![0.0; 4 * dim]);
                    group.bench_function(BenchmarkId::new(kernels.level().name(), threads), |b| {
                        b.iter(|| exec.attend(black_box(&q), 3 * dim, &cache, &spans, &mut y));
                    });
                }
            }
        }
    }
}

fn elementwise(c: &mut Criterion) {
    let (rows, dim) = (4, 1024);
    let mut group = c.benchmark_group("elementwise");
    for kernels in levels() {
        let mut exec = exec(kernels, 1);
        let name = kernels.level().name();
        let mut x: Vec<f32> = (0..4 * 4096).map(|i| (i % 17) as f32 * 0.3 - 2.0).collect();
        group.bench_function(BenchmarkId::new("gelu_4x4096", name), |b| b.iter(|| exec.gelu(black_box(&mut x))));
        let (x, mut y) = (vec![0.5; rows * dim], vec![0.0; rows * dim]);
        let table = vec![1.0; 2 * dim];
        let shift = RowTable { table: &table, stride: 0, offset: 0, index: &[0; 4] };
        group.bench_function(BenchmarkId::new("norm_4x1024", name), |b| {
            b.iter(|| exec.norm(black_box(&x), rows, dim, shift, shift, &mut y));
        });
        let (cos, sin) = (vec![0.8; rows * 128], vec![0.6; rows * 128]);
        group.bench_function(BenchmarkId::new("rope_4x1024", name), |b| {
            b.iter(|| exec.rope(black_box(&mut y), rows, dim, 4, 256, &cos, &sin));
        });
        let m: Vec<[f32; 9]> = (0..508).map(|i| std::array::from_fn(|j| ((i * 9 + j) % 23) as f32 - 11.0)).collect();
        let mut r = m.clone();
        group.bench_function(BenchmarkId::new("polar_508", name), |b| b.iter(|| kernels.polar(black_box(&m), &mut r)));
    }
}

/// What a second thread costs: a product so small that the join dominates.
fn fork_join(c: &mut Criterion) {
    let mut group = c.benchmark_group("fork_join");
    if let Some(kernels) = levels().last() {
        let w = matrix(kernels, "i8", 128, 64);
        for threads in [1, 2] {
            let mut exec = exec(*kernels, threads);
            let (x, mut y) = (vec![0.5; 64], vec![0.0; 128]);
            group.bench_function(BenchmarkId::from_parameter(threads), |b| {
                b.iter(|| exec.linear(&w, black_box(&x), 1, &mut y, Epilogue::Store));
            });
        }
    }
}

fn quick() -> Criterion {
    Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(600))
}

criterion_group! { name = benches; config = quick(); targets = pass, linear, attend, elementwise, fork_join }
criterion_main!(benches);
