//! Reading the tensors of a bundle: floats as numbers, quantised weights where they lie.

use super::invalid;
use super::rewrite::{entries, floats as bytes_of};
use super::stored::pack;
use super::tensors::Tensors;
use super::{StoredData, StoredWeights, drawn};
use crate::error::{Error, ErrorKind, Result};
use crate::kernels::{I4_GROUP, Kernels, Matrix, Scheme, WeightData, Weights, signed};
use half::f16;
use half::slice::HalfFloatSliceExt;
use safetensors::Dtype;
use safetensors::tensor::TensorView;

/// Values of weights: copied, or, where every byte is a value, as they lie in the bundle.
enum Values<'a> {
    Copied(StoredData),
    I8 { q: &'a [u8], scale: Vec<f32> },
    I4 { q: &'a [u8], scale: Vec<f16> },
}

impl Values<'_> {
    fn borrow(&self, rows: usize, cols: usize) -> Weights<'_> {
        let data = match self {
            Self::Copied(data) => data.borrow(),
            Self::I8 { q, scale } => WeightData::I8 { q: signed(q), scale },
            Self::I4 { q, scale } => WeightData::I4 { q, scale },
        };
        Weights { rows, cols, data }
    }

    fn copied(self) -> StoredData {
        match self {
            Self::Copied(data) => data,
            Self::I8 { q, scale } => StoredData::I8 { q: signed(q).to_vec(), scale },
            Self::I4 { q, scale } => StoredData::I4 { q: q.to_vec(), scale },
        }
    }
}

impl<'a> Tensors<'a> {
    /// Reads a vector or matrix of the given shape, f32 or f16 in the file, as f32.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] when it is missing or of another dtype or shape,
    /// [`ErrorKind::BundleCorrupt`] when a number is not finite.
    pub fn f32(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>> {
        if self.drawn.is_some() {
            return Ok(self.draw(name, shape));
        }
        let view = self.view(name, Some(shape))?;
        floats(name, &view)
    }

    /// Reads a matrix `[rows, columns]` of any number of rows, as f32; returns the number of rows
    /// too.
    ///
    /// # Errors
    /// As [`Tensors::f32`].
    pub fn f32_rows(&self, name: &str, columns: usize) -> Result<(usize, Vec<f32>)> {
        if self.drawn.is_some() {
            let rows = drawn::rows(name);
            return Ok((rows, self.draw(name, &[rows, columns])));
        }
        let view = self.view(name, None)?;
        match view.shape() {
            &[rows, c] if c == columns && rows > 0 => Ok((rows, floats(name, &view)?)),
            shape => Err(invalid(format!("tensor {name} has shape {shape:?}, expected [n, {columns}]"))),
        }
    }

    /// Draws floats, and keeps them where that is asked for.
    fn draw(&self, name: &str, shape: &[usize]) -> Vec<f32> {
        let values = drawn::floats(name, shape);
        if let Some(kept) = &self.kept {
            kept.borrow_mut().entries.push((name.to_owned(), Dtype::F32, shape.to_vec(), bytes_of(&values)));
        }
        values
    }

    /// Reads the weights `{name}.weight` (`[outputs, inputs]`; higher ranks are flattened after the
    /// first axis) in the scheme that the config records, with `{name}.scale` where it has scales:
    ///
    /// | scheme | `{name}.weight` | `{name}.scale` |
    /// |---|---|---|
    /// | `f32`, `f16` | F32, F16 `[outputs, inputs]` | |
    /// | `i8` | I8 `[outputs, inputs]` | F32 `[outputs]` |
    /// | `i4` | U8 `[outputs, ceil(inputs / 2)]` | F16 `[outputs, ceil(inputs / 32)]` |
    ///
    /// # Errors
    /// As [`Tensors::f32`]; [`ErrorKind::BundleInvalid`] also when dtype and record disagree,
    /// [`ErrorKind::BundleCorrupt`] for a scale that is not finite, or of int8 negative.
    pub fn weights(&self, name: &str, outputs: usize, inputs: &[usize]) -> Result<StoredWeights> {
        let data = self.values(name, outputs, inputs)?.copied();
        Ok(StoredWeights { rows: outputs, cols: inputs.iter().product(), data })
    }

    /// Reads `{name}.weight` (as [`Tensors::weights`]) and `{name}.bias` and packs them for the
    /// kernels at hand. Quantised weights are packed from where they lie, and pages of a mapped
    /// file that have been packed leave this process's memory.
    ///
    /// # Errors
    /// As [`Tensors::weights`].
    pub fn linear(&self, kernels: Kernels, name: &str, outputs: usize, inputs: &[usize]) -> Result<Matrix> {
        let values = self.values(name, outputs, inputs)?;
        let bias = self.f32(&format!("{name}.bias"), &[outputs])?;
        let matrix = pack(kernels, values.borrow(outputs, inputs.iter().product()), name, Some(&bias));
        if let (Values::I8 { q, .. } | Values::I4 { q, .. }, Some(file)) = (values, self.file) {
            file.release(q);
        }
        Ok(matrix)
    }

    fn values(&self, name: &str, outputs: usize, inputs: &[usize]) -> Result<Values<'a>> {
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
            return Ok(Values::Copied(weights.data));
        }
        Ok(match self.recorded(&weight) {
            None => Values::Copied(self.plain(&weight, &shape)?),
            Some(scheme @ (Scheme::F32 | Scheme::F16)) => {
                let data = self.plain(&weight, &shape)?;
                match (scheme, &data) {
                    (Scheme::F32, StoredData::F32(_)) | (Scheme::F16, StoredData::F16(_)) => Values::Copied(data),
                    _ => return Err(disagree(&weight, scheme, self.view(&weight, None)?.dtype())),
                }
            }
            Some(Scheme::I8) => Values::I8 {
                q: self.bytes(&weight, &shape, Scheme::I8, Dtype::I8)?,
                scale: positive(&scale, self.f32(&scale, &[outputs])?)?,
            },
            Some(Scheme::I4) => {
                let q = self.bytes(&weight, &[outputs, cols.div_ceil(2)], Scheme::I4, Dtype::U8)?;
                let view = self.view(&scale, Some(&[outputs, cols.div_ceil(I4_GROUP)]))?;
                if view.dtype() != Dtype::F16 {
                    return Err(disagree(&scale, Scheme::F16, view.dtype()));
                }
                Values::I4 { q, scale: halves(&scale, view.data())? }
            }
        })
    }

    fn plain(&self, name: &str, shape: &[usize]) -> Result<StoredData> {
        let view = self.view(name, Some(shape))?;
        Ok(match view.dtype() {
            Dtype::F16 => StoredData::F16(halves(name, view.data())?),
            _ => StoredData::F32(floats(name, &view)?),
        })
    }

    fn bytes(&self, name: &str, shape: &[usize], scheme: Scheme, dtype: Dtype) -> Result<&'a [u8]> {
        let view = self.view(name, Some(shape))?;
        if view.dtype() == dtype { Ok(view.data()) } else { Err(disagree(name, scheme, view.dtype())) }
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

fn halves(name: &str, data: &[u8]) -> Result<Vec<f16>> {
    finite(name, data.as_chunks::<2>().0.iter().map(|b| f16::from_le_bytes(*b)).collect(), f16::is_finite)
}

fn floats(name: &str, view: &TensorView<'_>) -> Result<Vec<f32>> {
    let data = view.data();
    match view.dtype() {
        Dtype::F32 => {
            finite(name, data.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect(), f32::is_finite)
        }
        Dtype::F16 => Ok(halves(name, data)?.to_f32_vec()),
        other => Err(invalid(format!(
            "tensor {name} is {other:?}, and the config records no scheme for it; this build reads F32 and F16 there"
        ))),
    }
}

/// The values, if all are numbers; without an early end, which would keep compilers from looking at
/// many at once.
fn finite<T: Copy + std::fmt::Display>(name: &str, values: Vec<T>, is_finite: impl Fn(T) -> bool) -> Result<Vec<T>> {
    if values.iter().fold(true, |all, v| all & is_finite(*v)) {
        return Ok(values);
    }
    let i = values.iter().position(|v| !is_finite(*v)).unwrap_or(0);
    Err(Error::new(
        ErrorKind::BundleCorrupt,
        format!("tensor {name} holds {} at element {i}; fetch or export the bundle again", values[i]),
    ))
}
