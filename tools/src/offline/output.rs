//! A folder of results that appear together, or not at all.

use crate::export::replace::replace_all;
use crate::export::viewer::{self, Meta};
use crate::export::{write_atomically, write_motion};
use crate::metrics::Summary;
use crate::recording::Recording;
use std::path::{Path, PathBuf};
use visavis::{Error, ErrorKind, Result};

/// The files of a run: viewer, skeleton animation, glTF, VRM animation, metrics.
pub const FILES: [&str; 5] = ["index.html", "motion.bvh", "motion.glb", "motion.vrma", "metrics.json"];

/// The folder that results go to, known to be writable before anything is computed.
///
/// Files are made in a hidden folder inside it and renamed when all of them are whole. What an
/// earlier run left there stays untouched until then. Dropped before [`OutputFolder::write`] has
/// succeeded, it removes all that it made.
#[derive(Debug)]
pub struct OutputFolder {
    folder: PathBuf,
    staging: PathBuf,
    /// Folders that were not there before, outermost first.
    made: Vec<PathBuf>,
}

impl OutputFolder {
    /// Makes `folder` with its parents where they are missing, and makes sure that files can be
    /// written there.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] naming the folder that is a file or cannot be made or written, or the name
    /// among [`FILES`] that a folder occupies.
    pub fn prepare(folder: impl AsRef<Path>) -> Result<Self> {
        let folder = folder.as_ref();
        let mut this = Self { folder: folder.to_path_buf(), staging: PathBuf::new(), made: Vec::new() };
        let missing =
            folder.ancestors().take_while(|p| !p.as_os_str().is_empty() && std::fs::symlink_metadata(p).is_err());
        let mut missing: Vec<_> = missing.map(Path::to_path_buf).collect();
        missing.reverse();
        for path in missing {
            std::fs::create_dir(&path).map_err(|e| Error::io("make the output folder", &path, e))?;
            this.made.push(path);
        }
        if !folder.is_dir() {
            let e = std::io::Error::new(std::io::ErrorKind::NotADirectory, "it is a file, not a folder");
            return Err(Error::io("write results into it", folder, e));
        }
        for name in FILES {
            let path = folder.join(name);
            if path.is_dir() {
                let e = std::io::Error::new(std::io::ErrorKind::IsADirectory, "a folder has its name; move it away");
                return Err(Error::io("write the file", path, e));
            }
        }
        let staging = folder.join(format!(".visavis-{}.tmp", std::process::id()));
        // A run that was killed may have left one; process numbers come again.
        let _ = std::fs::remove_dir_all(&staging);
        std::fs::create_dir(&staging).map_err(|e| Error::io("write into the output folder", folder, e))?;
        this.staging = staging;
        Ok(this)
    }

    /// Writes all of [`FILES`] and returns their paths in that order.
    ///
    /// # Errors
    /// Those of the writers, and [`ErrorKind::Io`] when a finished file cannot be moved to its
    /// name.
    pub fn write(self, recording: &Recording, meta: &Meta, summary: &Summary) -> Result<[PathBuf; 5]> {
        if recording.frames.is_empty() {
            return Err(Error::new(ErrorKind::Argument, "there are no frames to write"));
        }
        let page = viewer::render(recording, meta);
        write_atomically(self.staging.join(FILES[0]), |w| w.write_all(page.as_bytes()))?;
        write_motion(recording, &self.staging)?;
        write_atomically(self.staging.join(FILES[4]), |w| w.write_all(summary.to_json().as_bytes()))?;
        self.publish()
    }

    fn publish(mut self) -> Result<[PathBuf; 5]> {
        let paths = FILES.map(|name| self.folder.join(name));
        let pairs: Vec<_> =
            FILES.iter().zip(&paths).map(|(name, path)| (self.staging.join(name), path.clone())).collect();
        replace_all(&pairs, &self.staging).map_err(|(i, e)| Error::io("write the file", &paths[i], e))?;
        self.made.clear();
        Ok(paths)
    }
}

impl OutputFolder {
    /// Address, from the folder, of the live page in one file that `web/build.sh` leaves beside it.
    pub fn live_page(&self) -> Option<String> {
        const PAGE: &str = "../web/visavis.html";
        self.folder.join(PAGE).is_file().then(|| PAGE.to_owned())
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        // Best effort: the error that led here is the one to report. Folders that hold something by
        // now are kept.
        if !self.staging.as_os_str().is_empty() {
            let _ = std::fs::remove_dir_all(&self.staging);
        }
        for folder in self.made.iter().rev() {
            let _ = std::fs::remove_dir(folder);
        }
    }
}
