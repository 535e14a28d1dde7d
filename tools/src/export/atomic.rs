//! Files that appear whole or not at all.

use super::replace::replace;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use visavis::{Error, ErrorKind, Result};

/// Removes the temporary file unless it became the target.
struct Temporary {
    path: PathBuf,
    kept: bool,
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if !self.kept {
            // Best effort: the error that led here is the one to report.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Writes a file through `write` so that `path` is either the whole new file or what it was before:
/// the bytes go to a hidden temporary file beside the target, are flushed to the disk, and the file
/// is renamed (on Windows a program that holds `path` open may forbid that). The temporary file is removed when anything fails, also when `write` panics.
///
/// # Errors
/// [`ErrorKind::Io`] naming `path`: the folder is missing or not writable, `path` is a folder, the
/// disk is full, or `write` itself failed. [`ErrorKind::Argument`] if `path` has no file name.
pub fn write_atomically<F>(path: impl AsRef<Path>, write: F) -> Result<()>
where
    F: FnOnce(&mut dyn Write) -> io::Result<()>,
{
    let path = path.as_ref();
    let (file, mut temporary) = create_beside(path)?;
    let mut writer = BufWriter::with_capacity(1 << 16, file);
    let done = write(&mut writer)
        .and_then(|()| writer.into_inner().map_err(io::IntoInnerError::into_error))
        .and_then(|file| file.sync_all())
        .and_then(|()| replace(&temporary.path, path));
    done.map_err(|e| Error::io("write the file", path, e))?;
    temporary.kept = true;
    Ok(())
}

fn create_beside(path: &Path) -> Result<(File, Temporary)> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let Some(name) = path.file_name() else {
        return Err(Error::new(ErrorKind::Argument, "is not a file name; give the path of a file").with_path(path));
    };
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}-{number}.tmp", std::process::id()));
    let beside = path.with_file_name(hidden);
    let file = OpenOptions::new().write(true).create_new(true).open(&beside);
    let file = file.map_err(|e| Error::io("create the file", path, e))?;
    Ok((file, Temporary { path: beside, kept: false }))
}

#[cfg(test)]
mod tests {
    use super::super::scratch::Scratch;
    use super::*;

    #[test]
    fn whole_or_not_at_all() {
        let dir = Scratch::new("atomic");
        let path = dir.path("a.txt");
        let full = |w: &mut dyn Write| {
            w.write_all(&[b'x'; 300_000])?;
            Err(io::Error::new(io::ErrorKind::StorageFull, "no space left"))
        };
        let e = write_atomically(&path, full).unwrap_err();
        assert_eq!((e.kind(), e.path()), (ErrorKind::Io, Some(path.as_path())));
        assert!(e.to_string().contains("no space left"), "{e}");
        assert!(dir.is_empty(), "half of it was left");

        write_atomically(&path, |w| w.write_all(b"one")).unwrap();
        write_atomically(&path, full).unwrap_err();
        assert_eq!(std::fs::read(&path).unwrap(), b"one", "the old file stays");
        write_atomically(&path, |w| w.write_all(b"two")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"two");
        std::fs::remove_file(&path).unwrap();
        assert!(dir.is_empty());
    }

    #[test]
    fn panics_leave_nothing() {
        let dir = Scratch::new("atomic-panic");
        let path = dir.path("a.txt");
        let panic = std::panic::catch_unwind(|| write_atomically(&path, |_| panic!("on purpose")));
        assert!(panic.is_err() && dir.is_empty());
    }

    #[test]
    fn unwritable_targets_are_named() {
        let dir = Scratch::new("atomic-unwritable");
        let missing = dir.path("no/such/folder/a.txt");
        let folder = dir.path("folder");
        std::fs::create_dir(&folder).unwrap();
        for path in [missing, folder.clone()] {
            let e = write_atomically(&path, |w| w.write_all(b"x")).unwrap_err();
            assert_eq!((e.kind(), e.path()), (ErrorKind::Io, Some(path.as_path())));
        }
        std::fs::remove_dir(&folder).unwrap();
        assert!(dir.is_empty(), "a temporary file was left");
        assert_eq!(write_atomically("/", |_| Ok(())).unwrap_err().kind(), ErrorKind::Argument);
    }
}
