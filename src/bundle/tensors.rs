//! Typed, checked access to the tensors of a bundle.

use super::file::invalid;
use crate::error::{Error, ErrorKind, Result};
use crate::kernels::{Kernels, Matrix, WeightData, Weights};
use half::f16;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::cell::RefCell;
use std::collections::HashSet;

/// The tensors of a parsed bundle. Each read checks name, dtype, shape and finiteness, and is remembered, so that
/// [`Tensors::finish`] can name what nobody asked for.
#[derive(Debug)]
pub struct Tensors<'a> {
    container: SafeTensors<'a>,
    read: RefCell<HashSet<String>>,
}

impl<'a> Tensors<'a> {
    pub(super) fn new(container: SafeTensors<'a>) -> Self {
        Self { container, read: RefCell::default() }
    }

    /// Names, dtypes, shapes and sizes, sorted by name.
    pub fn infos(&self) -> Vec<super::TensorInfo> {
        let mut infos: Vec<_> = (self.container.iter())
            .map(|(name, view)| super::TensorInfo {
                name: name.to_owned(),
                dtype: format!("{:?}", view.dtype()).to_lowercase(),
                shape: view.shape().to_vec(),
                bytes: view.data().len(),
            })
            .collect();
        infos.sort_by(|a, b| a.name.cmp(&b.name));
        infos
    }

    /// Reads a vector or matrix of the given shape, f32 or f16 in the file, as f32.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] when it is missing or of another dtype or shape, [`ErrorKind::BundleCorrupt`] when
    /// a number is not finite.
    pub fn f32(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>> {
        let view = self.view(name, Some(shape))?;
        floats(name, &view)
    }

    /// Reads a matrix `[rows, columns]` of any number of rows, as f32; returns the number of rows too.
    ///
    /// # Errors
    /// As [`Tensors::f32`].
    pub fn f32_rows(&self, name: &str, columns: usize) -> Result<(usize, Vec<f32>)> {
        let view = self.view(name, None)?;
        match view.shape() {
            &[rows, c] if c == columns && rows > 0 => Ok((rows, floats(name, &view)?)),
            shape => Err(invalid(format!("tensor {name} has shape {shape:?}, expected [n, {columns}]"))),
        }
    }

    /// Reads `{name}.weight` (`[outputs, inputs]`; higher ranks are flattened after the first axis) and `{name}.bias`
    /// and packs them for the kernels at hand.
    ///
    /// # Errors
    /// As [`Tensors::f32`].
    pub fn linear(&self, kernels: Kernels, name: &str, outputs: usize, inputs: &[usize]) -> Result<Matrix> {
        let mut shape = vec![outputs];
        shape.extend_from_slice(inputs);
        let weight = self.f32(&format!("{name}.weight"), &shape)?;
        let bias = self.f32(&format!("{name}.bias"), &[outputs])?;
        let weights = Weights { rows: outputs, cols: inputs.iter().product(), data: WeightData::F32(&weight) };
        Ok(kernels.pack(weights, Some(&bias)))
    }

    /// Fails if the bundle holds tensors that nothing has read.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] naming the first of them.
    pub fn finish(&self) -> Result<()> {
        let read = self.read.borrow();
        let mut unread: Vec<_> = self.container.names().into_iter().filter(|n| !read.contains(*n)).collect();
        unread.sort_unstable();
        match unread.first() {
            None => Ok(()),
            Some(name) => Err(invalid(format!(
                "{} tensors are not part of the network that the config describes, {name} the first; export the bundle again",
                unread.len()
            ))),
        }
    }

    fn view(&self, name: &str, shape: Option<&[usize]>) -> Result<TensorView<'a>> {
        let view = (self.container.tensor(name))
            .map_err(|_| invalid(format!("tensor {name} is missing; export the bundle again")))?;
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

fn floats(name: &str, view: &TensorView<'_>) -> Result<Vec<f32>> {
    let data = view.data();
    let values: Vec<f32> = match view.dtype() {
        Dtype::F32 => data.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect(),
        Dtype::F16 => data.chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()).collect(),
        other => return Err(invalid(format!("tensor {name} is {other:?}; this build reads F32 and F16"))),
    };
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(values),
        Some(i) => Err(Error::new(
            ErrorKind::BundleCorrupt,
            format!("tensor {name} holds {} at element {i}; fetch or export the bundle again", values[i]),
        )),
    }
}
