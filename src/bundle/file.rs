//! The bytes of a bundle, from a mapped file or from memory.

use super::{CONFIG_KEY, corrupt, invalid};
use crate::error::{Error, ErrorKind, Result};
#[cfg(not(any(target_os = "android", target_family = "wasm")))]
use memmap2::Mmap;
use safetensors::SafeTensors;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Longest file that is copied to memory, bytes.
const MAX_COPY: u64 = 4 << 30;

/// Smallest part that is worth a system call to let go of, bytes.
#[cfg(all(unix, not(target_os = "android")))]
const RELEASED: usize = 1 << 18;

/// How a bundle's file is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum LoadMode {
    /// Mapped: pages are read as they are needed and belong to the system's cache. The file must
    /// not be changed or cut while it is being loaded: numbers that change are checked like any
    /// others, but **a file that is cut while it is mapped kills the process** with a bus error
    /// (`SIGBUS`) where the system has mapped files at all. Replacing it by a rename, as installers
    /// do, is fine: the mapped file lives on. Once an engine has been made, its file is not read
    /// again.
    #[default]
    Map,
    /// Copied to memory first, and read once: whatever happens to the file, the outcome is an
    /// engine or a typed error. Takes the file's size of memory while loading. For files that
    /// others may write to.
    Copy,
}

/// An opened bundle: its bytes, with the container already checked.
#[derive(Debug)]
pub struct BundleFile<'a> {
    bytes: Bytes<'a>,
    path: PathBuf,
}

#[derive(Debug)]
enum Bytes<'a> {
    #[cfg(not(any(target_os = "android", target_family = "wasm")))]
    Mapped(Mmap),
    Owned(Vec<u8>),
    Borrowed(&'a [u8]),
}

impl<'a> BundleFile<'a> {
    /// Maps the file at `path` (Android, WebAssembly: reads it): see [`LoadMode::Map`] for what must not
    /// happen to it meanwhile.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] when it cannot be opened or mapped.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::open_with(path, LoadMode::Map)
    }

    /// Maps or copies the file at `path`.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] when it cannot be opened, mapped or read, or is longer than 4 GiB and to
    /// be copied.
    pub fn open_with(path: impl AsRef<Path>, mode: LoadMode) -> Result<Self> {
        let path = path.as_ref();
        if mode == LoadMode::Copy {
            let bytes = crate::bounded::read(path, MAX_COPY).map_err(|e| Error::io("read the bundle", path, e))?;
            return Ok(Self::from_bytes(bytes, path));
        }
        let io = |e| Error::io("open the bundle", path, e);
        Self::open_part(&File::open(path).map_err(io)?, 0, None, path)
    }

    /// Maps (on Android: reads) `length` bytes from `offset` on of an open file (`None`: all that
    /// follow): a bundle that lies in another file, such as an asset that is stored uncompressed in
    /// an APK. `name` stands for it in errors. The file may be closed afterwards; otherwise as
    /// [`BundleFile::open`].
    ///
    /// # Errors
    /// [`ErrorKind::Io`] when it cannot be mapped, [`ErrorKind::Argument`] when the file is
    /// shorter.
    pub fn open_part(file: &File, offset: u64, length: Option<u64>, name: impl Into<PathBuf>) -> Result<Self> {
        let path = name.into();
        let io = |e| Error::io("map the bundle", &path, e);
        let there = file.metadata().map_err(io)?.len();
        let length = length.unwrap_or(there.saturating_sub(offset));
        if offset.checked_add(length).is_none_or(|end| end > there) {
            let message =
                format!("{length} bytes from offset {offset} on are asked for, but the file has {there} bytes");
            return Err(Error::new(ErrorKind::Argument, message).with_path(path));
        }
        if length == 0 {
            return Err(corrupt("the file is empty; fetch the bundle again").with_path(path));
        }
        Ok(Self { bytes: contents(file, offset, length as usize).map_err(io)?, path })
    }

    /// Takes a bundle that is already in memory; `name` stands for it in errors.
    pub fn from_bytes(bytes: Vec<u8>, name: impl Into<PathBuf>) -> Self {
        Self { bytes: Bytes::Owned(bytes), path: name.into() }
    }

    /// As [`BundleFile::from_bytes`], without taking or copying the bytes.
    pub fn from_slice(bytes: &'a [u8], name: impl Into<PathBuf>) -> Self {
        Self { bytes: Bytes::Borrowed(bytes), path: name.into() }
    }

    /// The file's path, or the name given to [`BundleFile::from_bytes`].
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Size in bytes.
    pub fn len(&self) -> usize {
        self.as_slice().len()
    }

    /// Whether there are no bytes at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(super) fn as_slice(&self) -> &[u8] {
        match &self.bytes {
            #[cfg(not(any(target_os = "android", target_family = "wasm")))]
            Bytes::Mapped(map) => map,
            Bytes::Owned(bytes) => bytes,
            Bytes::Borrowed(bytes) => bytes,
        }
    }

    /// Lets go of the pages of `part`, a part of these bytes that has been read: if the file is
    /// mapped they leave this process's memory, and reading them again would bring them back.
    #[cfg_attr(
        any(not(unix), target_os = "android"),
        allow(unused_variables, clippy::unused_self, reason = "nothing is mapped there")
    )]
    pub(super) fn release(&self, part: &[u8]) {
        #[cfg(all(unix, not(target_os = "android")))]
        if let (Bytes::Mapped(map), RELEASED..) = (&self.bytes, part.len()) {
            let from = part.as_ptr().addr() - map.as_ptr().addr();
            #[allow(unsafe_code, reason = "mapping a file is unsafe by nature")]
            // SAFETY: nobody writes through the map, so its pages hold what the file holds, and are
            // read from it again.
            let _ = unsafe { map.unchecked_advise_range(memmap2::UncheckedAdvice::DontNeed, from, part.len()) };
        }
    }

    /// The config as JSON and the container; neither has been looked into.
    pub(crate) fn raw(&self) -> Result<(String, SafeTensors<'_>)> {
        let bytes = self.as_slice();
        let container = |e| corrupt(format!("damaged safetensors container ({e}); fetch the bundle again"));
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(container)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(container)?;
        let json = metadata.metadata().as_ref().and_then(|m| m.get(CONFIG_KEY).cloned()).ok_or_else(|| {
            invalid(format!("a safetensors file, but not a Visavis bundle: its metadata has no \"{CONFIG_KEY}\" entry"))
        })?;
        Ok((json, tensors))
    }
}

/// `length` bytes of `file` from `offset` on.
#[cfg(not(any(target_os = "android", target_family = "wasm")))]
fn contents(file: &File, offset: u64, length: usize) -> std::io::Result<Bytes<'static>> {
    use memmap2::MmapOptions;
    #[allow(unsafe_code, reason = "mapping a file is unsafe by nature")]
    // SAFETY: the map is read-only and private. Should another process change the file while it is
    // being read, the reader may see changed numbers (they are checked after copying) or, if the
    // file shrinks, a bus error: the condition that `LoadMode::Map` states.
    let map = unsafe { MmapOptions::new().offset(offset).len(length).map(file) }?;
    Ok(Bytes::Mapped(map))
}

/// Read, not mapped: an app's files may be replaced under it, and a bus error would end the app.
#[cfg(target_os = "android")]
fn contents(file: &File, offset: u64, length: usize) -> std::io::Result<Bytes<'static>> {
    let mut bytes = vec![0; length];
    std::os::unix::fs::FileExt::read_exact_at(file, &mut bytes, offset)?;
    Ok(Bytes::Owned(bytes))
}

/// There are no maps: read, where the host has files at all.
#[cfg(target_family = "wasm")]
fn contents(mut file: &File, offset: u64, length: usize) -> std::io::Result<Bytes<'static>> {
    use std::io::{Read, Seek, SeekFrom};
    let mut bytes = vec![0; length];
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(&mut bytes)?;
    Ok(Bytes::Owned(bytes))
}
