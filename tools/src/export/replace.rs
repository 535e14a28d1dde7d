//! One file in the place of another.

use std::io;
use std::path::Path;

/// Renames `from` to `to`, in the place of what was there.
///
/// Windows refuses it while another program holds `to` open without sharing its deletion. Scanners
/// and indexers do so for moments after a file was written, so it is tried for half a second.
pub(crate) fn replace(from: &Path, to: &Path) -> io::Result<()> {
    let mut left = if cfg!(windows) { 10 } else { 0 };
    loop {
        match std::fs::rename(from, to) {
            Err(e) if is_held(&e) && left > 0 => std::thread::sleep(std::time::Duration::from_millis(50)),
            done => return done,
        }
        left -= 1;
    }
}

/// Whether Windows refused for what others have open; access is denied for that reason too.
fn is_held(error: &io::Error) -> bool {
    matches!(error.raw_os_error(), Some(5 | 32 | 33 | 1224))
}

/// Renames each file to its target. Should one fail on Windows, the targets that were there before
/// are put back. `aside` is a folder on the same disk for them.
///
/// Where files can always be replaced, each target is at any time the old file or the new one. On
/// Windows there are moments without either.
///
/// # Errors
/// The first error, and the index of the file.
pub(crate) fn replace_all<P: AsRef<Path>>(pairs: &[(P, P)], aside: &Path) -> Result<(), (usize, io::Error)> {
    let old = |i: usize| aside.join(format!("old-{i}"));
    let one = |i: usize, from: &Path, to: &Path| {
        if cfg!(windows) && to.exists() {
            replace(to, &old(i))?;
        }
        replace(from, to)
    };
    for (i, (from, to)) in pairs.iter().enumerate() {
        if let Err(e) = one(i, from.as_ref(), to.as_ref()) {
            // Best effort: the error that led here is the one to report.
            for (i, (_, to)) in pairs[..=i].iter().enumerate().rev().filter(|_| cfg!(windows)) {
                let _ = if old(i).exists() { replace(&old(i), to.as_ref()) } else { Ok(()) };
            }
            return Err((i, e));
        }
    }
    Ok(())
}
