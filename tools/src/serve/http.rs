//! HTTP for browsers on this machine: GET and HEAD, a connection for each request, a thread for each
//! connection. Browsers open six at once and hold on to them: none may wait for another.

use super::{Site, mime};
use std::fs::File;
use std::io::{BufRead, BufReader, Error, ErrorKind, Read, Result, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Largest head of a request, bytes.
const HEAD: u64 = 16 << 10;
/// How long a browser may keep a thread waiting.
const PATIENCE: Duration = Duration::from_secs(30);

/// Answers all that come, until the process ends.
pub fn serve(listener: &TcpListener, site: &Arc<Site>) {
    for stream in listener.incoming().flatten() {
        let site = Arc::clone(site);
        // Who goes away meanwhile is no error; who comes while there are no threads may come again.
        let _ = std::thread::Builder::new().spawn(move || answer(&stream, &site));
    }
}

fn answer(stream: &TcpStream, site: &Site) -> Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let line = request_line(stream)?;
    let mut words = line.split_ascii_whitespace();
    let (method, url, version) = (words.next(), words.next(), words.next());
    let (Some(method), Some(url), Some("HTTP/1.1" | "HTTP/1.0")) = (method, url, version) else {
        return refuse(stream, "400 Bad Request", "This is no request of a browser.");
    };
    if !matches!(method, "GET" | "HEAD") {
        return refuse(stream, "405 Method Not Allowed", "Files are read here, and nothing else.");
    }
    let found = site.find(url).and_then(|path| Some((File::open(&path).ok()?, path)));
    let Some((mut file, path)) = found else {
        return refuse(stream, "404 Not Found", "There is no such file here.");
    };
    let bytes = file.metadata()?.len();
    head(stream, "200 OK", mime(&path), bytes, cache(&path))?;
    if method == "GET" {
        std::io::copy(&mut file, &mut &*stream)?;
    }
    Ok(())
}

/// The first line of a request, whose head has been read to its end.
fn request_line(stream: &TcpStream) -> Result<String> {
    let mut lines = BufReader::new(stream.take(HEAD));
    let mut next = || {
        let mut line = Vec::new();
        lines.read_until(b'\n', &mut line)?;
        match line.ends_with(b"\n") {
            true => Ok(String::from_utf8_lossy(line.trim_ascii_end()).into_owned()),
            false => Err(Error::from(ErrorKind::InvalidData)),
        }
    };
    let first = next()?;
    while !next()?.is_empty() {}
    Ok(first)
}

fn head(mut stream: &TcpStream, status: &str, kind: &str, bytes: u64, cache: &str) -> Result<()> {
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {bytes}\r\nCache-Control: {cache}\r\nConnection: close\r\n\r\n"
    )
}

fn refuse(mut stream: &TcpStream, status: &str, why: &str) -> Result<()> {
    head(stream, status, "text/plain; charset=utf-8", why.len() as u64 + 1, "no-store")?;
    writeln!(stream, "{why}")
}

/// Names change with contents, but for the page and its worker.
fn cache(path: &Path) -> &'static str {
    let changes = path.extension().is_some_and(|e| e == "html") || path.ends_with("worker.js");
    if changes { "no-cache" } else { "max-age=31536000, immutable" }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::scratch::Scratch;

    fn started(scratch: &Scratch) -> std::net::SocketAddr {
        std::fs::write(scratch.path("index.html"), "page").unwrap();
        std::fs::write(scratch.path("live.js"), "script").unwrap();
        let site = Arc::new(Site::open(&scratch.path("")).unwrap());
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let address = listener.local_addr().unwrap();
        std::thread::spawn(move || serve(&listener, &site));
        address
    }

    fn told(address: std::net::SocketAddr, request: &str) -> String {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn files_are_given_out_and_all_else_is_refused() {
        let scratch = Scratch::new("serve-http");
        let address = started(&scratch);
        let page = told(address, "GET /?x HTTP/1.1\r\nHost: a\r\n\r\n");
        assert!(page.starts_with("HTTP/1.1 200 OK\r\nContent-Type: text/html"), "{page}");
        assert!(page.contains("Content-Length: 4\r\n") && page.contains("no-cache") && page.ends_with("\r\n\r\npage"));
        let head = told(address, "HEAD /live.js HTTP/1.1\r\n\r\n");
        assert!(head.contains("Content-Length: 6\r\n") && head.contains("immutable") && head.ends_with("\r\n\r\n"));
        for (request, status) in [
            ("GET /../Cargo.toml HTTP/1.1\r\n\r\n", "404"),
            ("POST / HTTP/1.1\r\n\r\n", "405"),
            ("\r\n\r\n", "400"),
            ("GET / SSH-2.0\r\n\r\n", "400"),
        ] {
            let answer = told(address, request);
            assert!(answer.starts_with(&format!("HTTP/1.1 {status} ")), "{request}: {answer}");
        }
        // More than a head, and a head that ends too early: no answer, and no harm.
        let mut stream = TcpStream::connect(address).unwrap();
        let _ = stream.write_all(&vec![b'a'; 2 * HEAD as usize]);
        drop(stream);
        assert!(told(address, "GET / HTTP/1.0\r\n\r\n").ends_with("page"));
    }

    #[test]
    fn connections_that_are_held_keep_nobody_waiting() {
        let scratch = Scratch::new("serve-held");
        let address = started(&scratch);
        let held: Vec<_> = (0..40).map(|_| TcpStream::connect(address).unwrap()).collect();
        assert!(told(address, "GET / HTTP/1.1\r\n\r\n").ends_with("page"));
        drop(held);
    }
}
