//! The scheme of each layer by measured sensitivity.
//!
//! 1. Each layer is quantised alone, and the error of teacher-forced blocks is measured: blocks of
//!    the reference sampler for the flow, single steps for the student, the way through encoder and
//!    decoder for the VAE.
//! 2. Layers are raised (int4 to int8 to f16; a level that would not help is skipped) one after the
//!    other, those first that give back the most squared error per byte, until the errors that are
//!    left, added in squares, are within the budget.
//! 3. The whole bundle is measured. While it is over the budget, the next layers are raised; each
//!    round raises at least one, so it ends at the latest when everything is f16.

use super::Rounder;
use super::keep::Keep;
use super::layers::Layer;
use super::scene::Scene;
use super::teacher::Teacher;
use super::write;
use crate::bundle::{BundleFile, StoredWeights};
use crate::engine::Engine;
use crate::error::Result;
use crate::frame::Sampler;
use crate::kernels::Scheme;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What `--auto` is given.
pub struct Budget<'a> {
    /// Largest mean joint error of teacher-forced blocks, millimetres.
    pub mm: f64,
    /// Blocks that sensitivity is measured on.
    pub scene: Scene,
    /// Told what is being done.
    pub progress: &'a dyn Fn(&str),
}

impl std::fmt::Debug for Budget<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Budget").field("mm", &self.mm).field("blocks", &self.scene.blocks()).finish_non_exhaustive()
    }
}

/// What a choice by sensitivity came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Error of each layer quantised alone, as first planned: millimetres, largest first.
    pub sensitivity: Vec<(String, Scheme, f64)>,
    /// Layers that were raised, in that order, and to what.
    pub raised: Vec<(String, Scheme)>,
    /// Error of the whole bundle before anything was raised, millimetres.
    pub before_mm: f64,
    /// Error of the result, millimetres.
    pub after_mm: f64,
}

/// A layer at its present scheme, and what raising it costs and gives.
struct Candidate<'a> {
    layer: &'a Layer,
    scheme: Scheme,
    /// Squared error, alone, at the present scheme.
    error: f64,
    /// The next better scheme that helps, and the squared error there.
    next: Option<(Scheme, f64)>,
}

/// Raises `schemes` until blocks are within `budget`. Layers that `keep` names keep the scheme that
/// it gave them.
pub(super) fn choose(
    file: &BundleFile<'_>,
    reference: &Arc<Engine>,
    rounder: &Rounder<'_>,
    mut schemes: BTreeMap<String, Scheme>,
    keep: &[Keep],
    budget: &Budget<'_>,
) -> Result<(BTreeMap<String, Scheme>, Choice)> {
    let meter = Meter::new(file, reference, rounder, budget)?;
    let mut candidates = Vec::new();
    for layer in rounder.layers {
        let scheme = schemes[&layer.name];
        let fixed = keep.iter().any(|k| k.fits(&layer.name));
        if fixed || scheme >= layer.weights.scheme().min(Scheme::F16) || !meter.reaches(&layer.name) {
            continue;
        }
        (budget.progress)(&format!("measuring {} at {scheme}", layer.name));
        let error = meter.alone(layer, scheme)?.powi(2);
        let mut candidate = Candidate { layer, scheme, error, next: None };
        candidate.look_ahead(&meter)?;
        candidates.push(candidate);
    }
    let mut sensitivity: Vec<_> = candidates.iter().map(|c| (c.layer.name.clone(), c.scheme, c.error.sqrt())).collect();
    sensitivity.sort_by(|a, b| b.2.total_cmp(&a.2));

    let before_mm = meter.whole(&schemes)?;
    let (mut raised, mut measured) = (Vec::new(), before_mm);
    // What errors measured alone add up to is an estimate: it is scaled to what the whole measures.
    while measured > budget.mm {
        let sum = |candidates: &[Candidate<'_>]| candidates.iter().map(|c| c.error).sum::<f64>();
        let goal = sum(&candidates) * (budget.mm / measured).powi(2);
        let mut progress = false;
        while !progress || sum(&candidates) > goal {
            let gain = |c: &Candidate<'_>| {
                c.next.map_or(f64::MIN, |(scheme, error)| (c.error - error) / extra_bytes(c.layer, c.scheme, scheme))
            };
            let best = (0..candidates.len()).max_by(|&a, &b| gain(&candidates[a]).total_cmp(&gain(&candidates[b])));
            let Some((best, (scheme, error))) = best.and_then(|i| Some((i, candidates[i].next?))) else { break };
            let candidate = &mut candidates[best];
            (candidate.scheme, candidate.error, candidate.next) = (scheme, error, None);
            candidate.look_ahead(&meter)?;
            schemes.insert(candidate.layer.name.clone(), scheme);
            raised.push((candidate.layer.name.clone(), scheme));
            progress = true;
        }
        if !progress {
            break;
        }
        measured = meter.whole(&schemes)?;
        (budget.progress)(&format!("{} layers raised: {measured:.3} mm", raised.len()));
    }
    Ok((schemes, Choice { sensitivity, raised, before_mm, after_mm: measured }))
}

impl Candidate<'_> {
    /// Finds the next better scheme that takes off at least half of the squared error; f16 counts
    /// as exact.
    fn look_ahead(&mut self, meter: &Meter<'_>) -> Result<()> {
        self.next = match self.scheme {
            Scheme::I4 => {
                let error = meter.alone(self.layer, Scheme::I8)?.powi(2);
                Some(if error <= 0.5 * self.error { (Scheme::I8, error) } else { (Scheme::F16, 0.0) })
            }
            Scheme::I8 => Some((Scheme::F16, 0.0)),
            Scheme::F16 | Scheme::F32 => None,
        };
        Ok(())
    }
}

/// Bytes that raising a layer adds.
fn extra_bytes(layer: &Layer, from: Scheme, to: Scheme) -> f64 {
    let bytes = |scheme| match scheme {
        Scheme::I4 => 0.5625,
        Scheme::I8 => 1.0,
        Scheme::F16 => 2.0,
        Scheme::F32 => 4.0,
    };
    layer.elements() as f64 * (bytes(to) - bytes(from))
}

/// Measures bundles by teacher-forced blocks.
struct Meter<'a> {
    file: &'a BundleFile<'a>,
    reference: &'a Arc<Engine>,
    rounder: &'a Rounder<'a>,
    teachers: Vec<Teacher>,
}

impl<'a> Meter<'a> {
    fn new(
        file: &'a BundleFile<'a>,
        reference: &'a Arc<Engine>,
        rounder: &'a Rounder<'a>,
        budget: &Budget<'_>,
    ) -> Result<Self> {
        let samplers = [Some(Sampler::Midpoint4), reference.config().student.map(|_| Sampler::Single)];
        let teachers = samplers
            .into_iter()
            .flatten()
            .map(|sampler| Teacher::new(reference, budget.scene.clone(), sampler, 0, &mut None))
            .collect::<Result<_>>()?;
        Ok(Self { file, reference, rounder, teachers })
    }

    /// Whether anything that is measured depends on layer `name`; the encoder's variance serves
    /// training alone.
    fn reaches(&self, name: &str) -> bool {
        name != "vae.encoder.logvar"
    }

    /// Error, millimetres, with one layer at `scheme` and all others as they were.
    fn alone(&self, layer: &Layer, scheme: Scheme) -> Result<f64> {
        let stored = self.rounder.one(layer, scheme)?;
        let student = layer.name.starts_with("student.");
        // The student's layers are seen by single steps alone; for all others the reference sampler
        // will do.
        let teachers = if student { &self.teachers[1..] } else { &self.teachers[..1] };
        self.measure(&[(layer, stored)], teachers)
    }

    fn whole(&self, schemes: &BTreeMap<String, Scheme>) -> Result<f64> {
        self.measure(&self.rounder.all(schemes)?, &self.teachers)
    }

    /// The largest of the errors: of each sampler's blocks, and of the way through encoder and
    /// decoder.
    fn measure(&self, weights: &[(&Layer, StoredWeights)], teachers: &[Teacher]) -> Result<f64> {
        // As an int8 bundle: there nothing but the matrices changes.
        let bytes = write::bundle(self.file, Some(self.reference), weights, Scheme::I8)?;
        let engine = Engine::from_file(&BundleFile::from_bytes(bytes, self.file.path()), self.reference.kernels())?;
        teachers.iter().try_fold(0.0, |worst: f64, teacher| {
            let forced = teacher.compare(&engine)?;
            Ok(worst.max(forced.mean_mm()).max(forced.round_trip_mm()))
        })
    }
}
