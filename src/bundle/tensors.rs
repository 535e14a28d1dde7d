//! Typed, checked access to the tensors of a bundle.

use super::file::invalid;
use super::rewrite::{Entry, assemble, entries, failed, floats as floats_of};
use super::{StoredData, StoredWeights, drawn};
use crate::config::{Config, Quantisation};
use crate::error::{Error, ErrorKind, Result};
use crate::kernels::{I4_GROUP, Kernels, Matrix, Scheme};
use half::f16;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::cell::RefCell;
use std::collections::{BTreeMap, HashSet};

/// The tensors of a parsed bundle. Each read checks name, dtype, shape and finiteness, and is remembered, so that
/// [`Tensors::finish`] can name what nobody asked for.
#[derive(Debug)]
pub struct Tensors<'a> {
    container: Option<SafeTensors<'a>>,
    /// Without a container: weights of this scheme are drawn as they are asked for.
    drawn: Option<Scheme>,
    quantisation: Option<Quantisation>,
    /// Of drawn tensors, where they are to be written.
    kept: Option<RefCell<Kept>>,
    read: RefCell<HashSet<String>>,
}

/// Tensors that were drawn, and the schemes of those that are weights.
#[derive(Debug)]
struct Kept {
    entries: Vec<Entry>,
    record: Quantisation,
}

impl<'a> Tensors<'a> {
    pub(super) fn new(container: SafeTensors<'a>, quantisation: Option<Quantisation>) -> Self {
        Self { container: Some(container), drawn: None, kept: None, quantisation, read: RefCell::default() }
    }

    /// No bundle: every tensor that is asked for is there, drawn from its name, weights of some size in `scheme`. To measure
    /// networks of sizes for which there is no bundle.
    pub(crate) fn seeded(scheme: Scheme) -> Self {
        Self { container: None, drawn: Some(scheme), kept: None, quantisation: None, read: RefCell::default() }
    }

    /// As [`Tensors::seeded`], and what has been asked for can be written: [`Tensors::bundle`].
    pub(crate) fn seeded_and_kept(scheme: Scheme) -> Self {
        let record = Quantisation { scheme, tensors: BTreeMap::new() };
        Self { kept: Some(RefCell::new(Kept { entries: Vec::new(), record })), ..Self::seeded(scheme) }
    }

    /// The bytes of a bundle of `config` and all tensors that were asked for.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] when it cannot be written.
    pub(crate) fn bundle(self, config: &Config) -> Result<Vec<u8>> {
        let kept = self.kept.map(RefCell::into_inner).ok_or_else(|| failed("its tensors were not kept"))?;
        let config = Config { quantisation: Some(kept.record), ..config.clone() };
        assemble(&serde_json::to_value(&config).map_err(failed)?, &kept.entries)
    }

    /// Draws floats, and keeps them where that is asked for.
    fn draw(&self, name: &str, shape: &[usize]) -> Vec<f32> {
        let values = drawn::floats(name, shape);
        if let Some(kept) = &self.kept {
            kept.borrow_mut().entries.push((name.to_owned(), Dtype::F32, shape.to_vec(), floats_of(&values)));
        }
        values
    }

    /// Names, dtypes, shapes and sizes, sorted by name; the dtype of quantised weights is their scheme.
    pub fn infos(&self) -> Vec<super::TensorInfo> {
        let mut infos: Vec<_> = (self.container.iter().flat_map(SafeTensors::iter))
            .map(|(name, view)| super::TensorInfo {
                name: name.to_owned(),
                dtype: match self.recorded(name) {
                    Some(scheme) => scheme.to_string(),
                    None => format!("{:?}", view.dtype()).to_lowercase(),
                },
                shape: view.shape().to_vec(),
                bytes: view.data().len(),
            })
            .collect();
        infos.sort_by(|a, b| a.name.cmp(&b.name));
        infos
    }

    /// Whether the bundle holds a tensor of this name.
    pub fn has(&self, name: &str) -> bool {
        self.container.as_ref().is_some_and(|container| container.tensor(name).is_ok())
    }

    /// Reads a vector or matrix of the given shape, f32 or f16 in the file, as f32.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] when it is missing or of another dtype or shape, [`ErrorKind::BundleCorrupt`] when
    /// a number is not finite.
    pub fn f32(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>> {
        if self.drawn.is_some() {
            return Ok(self.draw(name, shape));
        }
        let view = self.view(name, Some(shape))?;
        floats(name, &view)
    }

    /// Reads a matrix `[rows, columns]` of any number of rows, as f32; returns the number of rows too.
    ///
    /// # Errors
    /// As [`Tensors::f32`].
    pub fn f32_rows(&self, name: &str, columns: usize) -> Result<(usize, Vec<f32>)> {
        if self.drawn.is_some() {
            return Ok((drawn::ROWS, self.draw(name, &[drawn::ROWS, columns])));
        }
        let view = self.view(name, None)?;
        match view.shape() {
            &[rows, c] if c == columns && rows > 0 => Ok((rows, floats(name, &view)?)),
            shape => Err(invalid(format!("tensor {name} has shape {shape:?}, expected [n, {columns}]"))),
        }
    }

    /// Reads the weights `{name}.weight` (`[outputs, inputs]`; higher ranks are flattened after the first axis) in the scheme that the
    /// config records, with `{name}.scale` where it has scales:
    ///
    /// | scheme | `{name}.weight` | `{name}.scale` |
    /// |---|---|---|
    /// | `f32`, `f16` | F32, F16 `[outputs, inputs]` | |
    /// | `i8` | I8 `[outputs, inputs]` | F32 `[outputs]` |
    /// | `i4` | U8 `[outputs, ceil(inputs / 2)]` | F16 `[outputs, ceil(inputs / 32)]` |
    ///
    /// # Errors
    /// As [`Tensors::f32`]; [`ErrorKind::BundleInvalid`] also when dtype and record disagree, [`ErrorKind::BundleCorrupt`] for a
    /// scale that is not finite, or of int8 negative.
    pub fn weights(&self, name: &str, outputs: usize, inputs: &[usize]) -> Result<StoredWeights> {
        let (weight, scale) = (format!("{name}.weight"), format!("{name}.scale"));
        let cols = inputs.iter().product::<usize>();
        let shape = [&[outputs], inputs].concat();
        if let Some(scheme) = self.drawn {
            let weights = drawn::weights(&weight, outputs, cols, scheme);
            if let Some(kept) = &self.kept {
                let mut kept = kept.borrow_mut();
                kept.entries.extend(entries(name, &shape, &weights));
                kept.record.tensors.insert(weight, weights.scheme());
            }
            return Ok(weights);
        }
        let data = match self.recorded(&weight) {
            None => self.plain(&weight, &shape)?,
            Some(scheme @ (Scheme::F32 | Scheme::F16)) => {
                let data = self.plain(&weight, &shape)?;
                match (scheme, &data) {
                    (Scheme::F32, StoredData::F32(_)) | (Scheme::F16, StoredData::F16(_)) => data,
                    _ => return Err(disagree(&weight, scheme, self.view(&weight, None)?.dtype())),
                }
            }
            Some(Scheme::I8) => StoredData::I8 {
                q: self.bytes(&weight, &shape, Scheme::I8, Dtype::I8)?.iter().map(|&b| b as i8).collect(),
                scale: positive(&scale, self.f32(&scale, &[outputs])?)?,
            },
            Some(Scheme::I4) => {
                let q = self.bytes(&weight, &[outputs, cols.div_ceil(2)], Scheme::I4, Dtype::U8)?.to_vec();
                let view = self.view(&scale, Some(&[outputs, cols.div_ceil(I4_GROUP)]))?;
                if view.dtype() != Dtype::F16 {
                    return Err(disagree(&scale, Scheme::F16, view.dtype()));
                }
                floats(&scale, &view)?;
                StoredData::I4 { q, scale: halves(view.data()) }
            }
        };
        Ok(StoredWeights { rows: outputs, cols, data })
    }

    /// Reads `{name}.weight` (as [`Tensors::weights`]) and `{name}.bias` and packs them for the kernels at hand.
    ///
    /// # Errors
    /// As [`Tensors::weights`].
    pub fn linear(&self, kernels: Kernels, name: &str, outputs: usize, inputs: &[usize]) -> Result<Matrix> {
        let weights = self.weights(name, outputs, inputs)?;
        let bias = self.f32(&format!("{name}.bias"), &[outputs])?;
        Ok(kernels.pack(weights.borrow(), Some(&bias)).named(name))
    }

    /// Leaves the tensors whose names begin with `prefix` alone: [`Tensors::finish`] does not miss them.
    pub fn skip(&self, prefix: &str) {
        let recorded = self.quantisation.iter().flat_map(|q| q.tensors.keys().map(String::as_str));
        let names = self.container.iter().flat_map(SafeTensors::names).chain(recorded);
        self.read.borrow_mut().extend(names.filter(|name| name.starts_with(prefix)).map(str::to_owned));
    }

    /// Fails if the bundle holds, or its config records, tensors that nothing has read.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] naming the first of them.
    pub fn finish(&self) -> Result<()> {
        let read = self.read.borrow();
        let recorded = self.quantisation.iter().flat_map(|q| q.tensors.keys().map(String::as_str));
        let mut unread: Vec<_> =
            self.container.iter().flat_map(SafeTensors::names).chain(recorded).filter(|n| !read.contains(*n)).collect();
        unread.sort_unstable();
        unread.dedup();
        match unread.first() {
            None => Ok(()),
            Some(name) => Err(invalid(format!(
                "{} tensors are not part of the network that the config describes, {name} the first; export the bundle again",
                unread.len()
            ))),
        }
    }

    /// The scheme that the config records for a tensor.
    fn recorded(&self, name: &str) -> Option<Scheme> {
        self.quantisation.as_ref()?.tensors.get(name).copied()
    }

    fn plain(&self, name: &str, shape: &[usize]) -> Result<StoredData> {
        let view = self.view(name, Some(shape))?;
        let values = floats(name, &view)?;
        Ok(if view.dtype() == Dtype::F16 { StoredData::F16(halves(view.data())) } else { StoredData::F32(values) })
    }

    fn bytes(&self, name: &str, shape: &[usize], scheme: Scheme, dtype: Dtype) -> Result<&'a [u8]> {
        let view = self.view(name, Some(shape))?;
        if view.dtype() == dtype { Ok(view.data()) } else { Err(disagree(name, scheme, view.dtype())) }
    }

    fn view(&self, name: &str, shape: Option<&[usize]>) -> Result<TensorView<'a>> {
        let view = (self.container.as_ref())
            .and_then(|container| container.tensor(name).ok())
            .ok_or_else(|| invalid(format!("tensor {name} is missing; export the bundle again")))?;
        if let Some(shape) = shape
            && view.shape() != shape
        {
            let found = view.shape();
            return Err(invalid(format!("tensor {name} has shape {found:?}, but the config says {shape:?}")));
        }
        self.read.borrow_mut().insert(name.to_owned());
        Ok(view)
    }
}

fn disagree(name: &str, scheme: Scheme, dtype: Dtype) -> Error {
    invalid(format!("tensor {name} is {dtype:?}, but the config says {scheme}; quantise the original bundle again"))
}

fn positive(name: &str, scales: Vec<f32>) -> Result<Vec<f32>> {
    match scales.iter().position(|s| *s < 0.0) {
        None => Ok(scales),
        Some(i) => Err(Error::new(
            ErrorKind::BundleCorrupt,
            format!(
                "tensor {name} holds {} at element {i}, but scales are not negative; fetch the bundle again",
                scales[i]
            ),
        )),
    }
}

fn halves(data: &[u8]) -> Vec<f16> {
    data.chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]])).collect()
}

fn floats(name: &str, view: &TensorView<'_>) -> Result<Vec<f32>> {
    let data = view.data();
    let values: Vec<f32> = match view.dtype() {
        Dtype::F32 => data.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect(),
        Dtype::F16 => halves(data).into_iter().map(f16::to_f32).collect(),
        other => {
            return Err(invalid(format!(
                "tensor {name} is {other:?}, and the config records no scheme for it; this build reads F32 and F16 there"
            )));
        }
    };
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(values),
        Some(i) => Err(Error::new(
            ErrorKind::BundleCorrupt,
            format!("tensor {name} holds {} at element {i}; fetch or export the bundle again", values[i]),
        )),
    }
}
