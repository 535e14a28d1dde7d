//! The tensors of a bundle: which there are, and which of them were asked for.

use super::BundleFile;
use super::invalid;
use super::rewrite::{Entry, assemble, failed};
use crate::config::{Config, Quantisation};
use crate::error::Result;
use crate::kernels::Scheme;
use safetensors::SafeTensors;
use safetensors::tensor::TensorView;
use serde::Serialize;
use std::cell::RefCell;
use std::collections::{BTreeMap, HashSet};

/// One tensor of a bundle.
#[derive(Debug, Clone, Serialize)]
pub struct TensorInfo {
    /// Name.
    pub name: String,
    /// Storage type: `f32` or `f16`, for quantised weights their scheme (`i8`, `i4`).
    pub dtype: String,
    /// Shape, row-major; two int4 weights count as one element.
    pub shape: Vec<usize>,
    /// Bytes in the file.
    pub bytes: usize,
}

impl TensorInfo {
    /// Number of parameters; the padding of int4 rows of odd length counts, scales of quantised
    /// weights do not.
    pub fn elements(&self) -> usize {
        let n = self.shape.iter().product();
        match self.dtype.as_str() {
            "i4" => 2 * n,
            _ if self.name.ends_with(".scale") => 0,
            _ => n,
        }
    }
}

/// The tensors of a parsed bundle. Each read checks name, dtype, shape and finiteness, and is
/// remembered, so that [`Tensors::finish`] can name what nobody asked for.
#[derive(Debug)]
pub struct Tensors<'a> {
    container: Option<SafeTensors<'a>>,
    /// Where the container lies.
    pub(super) file: Option<&'a BundleFile<'a>>,
    /// Without a container: weights of this scheme are drawn as they are asked for.
    pub(super) drawn: Option<Scheme>,
    quantisation: Option<Quantisation>,
    /// Of drawn tensors, where they are to be written.
    pub(super) kept: Option<RefCell<Kept>>,
    read: RefCell<HashSet<String>>,
}

/// Tensors that were drawn, and the schemes of those that are weights.
#[derive(Debug)]
pub(super) struct Kept {
    pub(super) entries: Vec<Entry>,
    pub(super) record: Quantisation,
}

impl<'a> Tensors<'a> {
    pub(super) fn new(
        file: &'a BundleFile<'a>,
        container: SafeTensors<'a>,
        quantisation: Option<Quantisation>,
    ) -> Self {
        let (container, file) = (Some(container), Some(file));
        Self { container, file, drawn: None, kept: None, quantisation, read: RefCell::default() }
    }

    /// No bundle: every tensor that is asked for is there, drawn from its name, weights of some
    /// size in `scheme`. To measure networks of sizes for which there is no bundle.
    #[cfg(feature = "internals")]
    pub fn seeded(scheme: Scheme) -> Self {
        let drawn = Some(scheme);
        Self { container: None, file: None, drawn, kept: None, quantisation: None, read: RefCell::default() }
    }

    /// As [`Tensors::seeded`], and what has been asked for can be written: [`Tensors::bundle`].
    #[cfg(feature = "internals")]
    pub fn seeded_and_kept(scheme: Scheme) -> Self {
        let record = Quantisation { scheme, tensors: BTreeMap::new() };
        Self { kept: Some(RefCell::new(Kept { entries: Vec::new(), record })), ..Self::seeded(scheme) }
    }

    /// The bytes of a bundle of `config` and all tensors that were asked for.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] when it cannot be written.
    #[cfg(feature = "internals")]
    pub fn bundle(self, config: &Config) -> Result<Vec<u8>> {
        let kept = self.kept.map(RefCell::into_inner).ok_or_else(|| failed("its tensors were not kept"))?;
        let config = Config { quantisation: Some(kept.record), ..config.clone() };
        assemble(&serde_json::to_value(&config).map_err(failed)?, &kept.entries)
    }

    /// Names, dtypes, shapes and sizes, sorted by name; the dtype of quantised weights is their
    /// scheme.
    pub fn infos(&self) -> Vec<TensorInfo> {
        let mut infos: Vec<_> = (self.container.iter().flat_map(SafeTensors::iter))
            .map(|(name, view)| TensorInfo {
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

    /// Whether the bundle holds a tensor of this name; one that is drawn, whatever bundles of its
    /// scheme may hold.
    pub fn has(&self, name: &str) -> bool {
        match (&self.container, self.drawn) {
            (Some(container), _) => container.tensor(name).is_ok(),
            (None, scheme) => scheme.is_some_and(|scheme| scheme != Scheme::F32),
        }
    }

    /// Leaves the tensors whose names begin with `prefix` alone: [`Tensors::finish`] does not miss
    /// them.
    pub fn skip(&self, prefix: &str) {
        let recorded = self.quantisation.iter().flat_map(|q| q.tensors.keys().map(String::as_str));
        let names = self.container.iter().flat_map(SafeTensors::names).chain(recorded);
        self.read.borrow_mut().extend(names.filter(|name| name.starts_with(prefix)).map(str::to_owned));
    }

    /// Fails if the bundle holds, or its config records, tensors that nothing has read.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`](crate::error::ErrorKind::BundleInvalid) naming the first of
    /// them.
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
    pub(super) fn recorded(&self, name: &str) -> Option<Scheme> {
        self.quantisation.as_ref()?.tensors.get(name).copied()
    }

    pub(super) fn view(&self, name: &str, shape: Option<&[usize]>) -> Result<TensorView<'a>> {
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
