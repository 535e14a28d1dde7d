//! A folder of files by the paths of requests, given out to browsers on this machine: `visavis live`.

mod http;

pub use http::serve;

use std::path::{Path, PathBuf};
use visavis::{Error, ErrorKind, Result};

/// The live page's folder.
#[derive(Debug)]
pub struct Site {
    root: PathBuf,
}

impl Site {
    /// Opens the folder.
    ///
    /// # Errors
    /// [`Io`](ErrorKind::Io), naming the folder, where it is not there or holds no page; the message
    /// tells how to make it.
    pub fn open(folder: &Path) -> Result<Self> {
        let missing = |what: &str| {
            let message = format!("{what}; make it with web/build.sh, or name the folder with --dir");
            Error::new(ErrorKind::Io, message).with_path(folder)
        };
        let root = folder.canonicalize().map_err(|e| missing(&format!("the live page is not there ({e})")))?;
        if !root.join("index.html").is_file() {
            return Err(missing("there is no index.html, so this is not the live page"));
        }
        Ok(Self { root })
    }

    /// The file of a request's path, or `None` where there is none inside the folder: no way leads
    /// out of it, by dots, by escapes or by links.
    pub fn find(&self, url: &str) -> Option<PathBuf> {
        let path = url.split(['?', '#']).next()?;
        let path = unescaped(path)?;
        let name = path.strip_prefix('/')?;
        let plain = |part: &str| !part.starts_with('.') && !part.contains(['\\', '\0', ':']);
        if name.split('/').any(|part| !plain(part)) {
            return None;
        }
        let mut file = self.root.join(name);
        if name.is_empty() || name.ends_with('/') {
            file.push("index.html");
        }
        let file = file.canonicalize().ok()?;
        (file.starts_with(&self.root) && file.is_file()).then_some(file)
    }
}

/// Percent escapes undone; `None` for broken ones and for what is not UTF-8.
fn unescaped(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&byte, tail)) = rest.split_first() {
        rest = tail;
        if byte != b'%' {
            bytes.push(byte);
            continue;
        }
        let digits = std::str::from_utf8(rest.get(..2)?).ok()?;
        bytes.push(u8::from_str_radix(digits, 16).ok()?);
        rest = &rest[2..];
    }
    String::from_utf8(bytes).ok()
}

/// Content type by a file's ending.
pub fn mime(path: &Path) -> &'static str {
    match path.extension().and_then(|e| e.to_str()) {
        Some("html") => "text/html; charset=utf-8",
        Some("js" | "mjs") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("json") => "application/json",
        Some("wasm") => "application/wasm",
        Some("txt") => "text/plain; charset=utf-8",
        Some("png") => "image/png",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::scratch::Scratch;

    fn site(scratch: &Scratch) -> Site {
        let folder = scratch.path("site");
        std::fs::create_dir_all(folder.join("part")).unwrap();
        for name in ["index.html", "live.js", "part/index.html", "a b.gz", ".hidden"] {
            std::fs::write(folder.join(name), name).unwrap();
        }
        std::fs::write(scratch.path("secret.txt"), "secret").unwrap();
        Site::open(&folder).unwrap()
    }

    #[test]
    fn files_are_found_by_their_paths() {
        let scratch = Scratch::new("serve-found");
        let site = site(&scratch);
        for (url, name) in [
            ("/", "index.html"),
            ("/?x=1", "index.html"),
            ("/live.js", "live.js"),
            ("/part/", "part/index.html"),
            ("/a%20b.gz", "a b.gz"),
        ] {
            assert_eq!(std::fs::read_to_string(site.find(url).unwrap()).unwrap(), name, "{url}");
        }
    }

    #[test]
    fn no_way_leads_out() {
        let scratch = Scratch::new("serve-out");
        let site = site(&scratch);
        #[cfg(unix)]
        std::os::unix::fs::symlink(scratch.path("secret.txt"), scratch.path("site/link.txt")).unwrap();
        for url in [
            "/../secret.txt",
            "/%2e%2e/secret.txt",
            "/part/../../secret.txt",
            "/..%2fsecret.txt",
            "/link.txt",
            "//etc/passwd",
            "/.hidden",
            "secret.txt",
            "/%zz",
            "/%",
            "/%ff",
            "/live.js%00",
            "/..\\secret.txt",
            "/c:/secret.txt",
            "/nothing",
            "",
        ] {
            assert_eq!(site.find(url), None, "{url}");
        }
    }

    #[test]
    fn a_missing_folder_is_an_error_that_tells_what_to_do() {
        let scratch = Scratch::new("serve-missing");
        for folder in [scratch.path("nothing"), scratch.path("")] {
            let error = Site::open(&folder).unwrap_err();
            assert_eq!((error.kind(), error.path()), (ErrorKind::Io, Some(folder.as_path())));
            assert!(error.to_string().contains("web/build.sh"), "{error}");
        }
    }

    #[test]
    fn browsers_are_told_what_a_file_is() {
        assert_eq!(mime(Path::new("a/live-1.js")), "text/javascript; charset=utf-8");
        assert_eq!(mime(Path::new("x.wasm")), "application/wasm");
        assert_eq!(mime(Path::new("bundle")), "application/octet-stream");
    }
}
