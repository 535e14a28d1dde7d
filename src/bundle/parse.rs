//! From an opened file to a config that is sound and tensors that can be asked for.

use super::{BundleFile, Tensors, check, corrupt, invalid};
use crate::config::{Config, DramBundle, FORMAT, Kind, MospaBundle};
use crate::error::{Error, ErrorKind, Result};

/// Largest header that is parsed, bytes: metadata of thousands of tensors take well under one
/// mebibyte.
const MAX_HEADER: u64 = 4 << 20;

impl BundleFile<'_> {
    /// Parses the container and the config, and checks both.
    ///
    /// # Errors
    /// [`ErrorKind::BundleCorrupt`], [`ErrorKind::BundleVersion`] or [`ErrorKind::BundleInvalid`],
    /// naming the file.
    pub fn parse(&self) -> Result<(Config, Tensors<'_>)> {
        self.parse_inner().map_err(|e| e.with_path(self.path()))
    }

    fn parse_inner(&self) -> Result<(Config, Tensors<'_>)> {
        let bytes = self.as_slice();
        let header = bytes.first_chunk::<8>().map(|b| u64::from_le_bytes(*b));
        match header {
            None => return Err(corrupt("shorter than a safetensors header; fetch the bundle again")),
            Some(n) if n > MAX_HEADER || n > bytes.len() as u64 => {
                return Err(corrupt("not a safetensors file, or cut off inside its header; fetch the bundle again"));
            }
            Some(_) => {}
        }
        let (json, tensors) = self.raw()?;
        let config = parse_config(&json)?;
        check::config(&config)?;
        let quantisation = config.quantisation.clone();
        Ok((config, Tensors::new(self, tensors, quantisation)))
    }
}

fn parse_config(json: &str) -> Result<Config> {
    #[derive(serde::Deserialize)]
    struct Version {
        format: u32,
    }
    #[derive(serde::Deserialize)]
    struct Kinds {
        #[serde(default)]
        kind: Kind,
    }
    let unreadable = |e| invalid(format!("the bundle's config cannot be read: {e}; export the bundle again"));
    let version: Version = serde_json::from_str(json).map_err(unreadable)?;
    if version.format != FORMAT {
        let advice = if version.format > FORMAT { "update visavis" } else { "export the bundle again" };
        return Err(Error::new(
            ErrorKind::BundleVersion,
            format!("bundle format {}, but this build reads format {FORMAT}; {advice}", version.format),
        ));
    }
    match serde_json::from_str::<Kinds>(json).map_err(unreadable)?.kind {
        Kind::Sarah => serde_json::from_str(json).map_err(unreadable),
        Kind::Dram => serde_json::from_str::<DramBundle>(json).map_err(unreadable).map(Config::from),
        Kind::Mospa => serde_json::from_str::<MospaBundle>(json).map_err(unreadable).map(Config::from),
    }
}
