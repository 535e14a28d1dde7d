//! Reading whole files, never more of them than was agreed.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// The bytes of the file at `path`, which may be at most `most` long: pipes and devices that never
/// end are cut there.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let expected = file.metadata()?.len();
    if expected > most {
        return Err(too_long(most));
    }
    let mut bytes = Vec::with_capacity(expected as usize);
    file.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(too_long(most));
    }
    Ok(bytes)
}

fn too_long(most: u64) -> io::Error {
    io::Error::new(io::ErrorKind::FileTooLarge, format!("it is longer than {} MiB, which is the most", most >> 20))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_bounded() {
        let len = std::fs::metadata("Cargo.toml").unwrap().len();
        assert_eq!(read("Cargo.toml".as_ref(), len).unwrap().len() as u64, len);
        let e = read("Cargo.toml".as_ref(), len - 1).unwrap_err();
        assert_eq!(e.kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(read("no/such/file".as_ref(), len).unwrap_err().kind(), io::ErrorKind::NotFound);
    }

    #[test]
    #[cfg(unix)]
    fn devices_without_an_end_are_cut() {
        assert_eq!(read("/dev/zero".as_ref(), 1 << 20).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        assert!(read("/dev/null".as_ref(), 1 << 20).unwrap().is_empty());
    }
}
