//! `visavis live`: the live page's folder, served on this machine.

use super::print;
use clap::Args;
use std::path::{Path, PathBuf};
use visavis::{Error, ErrorKind, Result};
use visavis_tools::serve::Site;

#[derive(Debug, Args)]
pub struct LiveArgs {
    /// Folder that web/build.sh makes
    #[arg(long, value_name = "DIR", default_value = "out/web/site")]
    pub dir: PathBuf,
    /// Port on 127.0.0.1; 0 takes a free one
    #[arg(long, value_name = "N", default_value_t = 8571)]
    pub port: u16,
}

pub fn run(args: &LiveArgs) -> Result<()> {
    let site = Site::open(&args.dir)?;
    let address = ("127.0.0.1", args.port);
    let server = tiny_http::Server::http(address).map_err(|e| {
        let message = format!("cannot listen on 127.0.0.1:{}: {e}; give another --port", args.port);
        Error::new(ErrorKind::Io, message)
    })?;
    let port = server.server_addr().to_ip().map_or(args.port, |a| a.port());
    print(&format!(
        "open    http://localhost:{port}/\nphone   adb reverse tcp:{port} tcp:{port}, then the same address there\nstop    Ctrl+C\n"
    ))?;
    // A browser fetches a handful of files side by side.
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| server.incoming_requests().for_each(|request| answer(&site, request)));
        }
    });
    Ok(())
}

/// Answers one request; who goes away meanwhile is no error.
fn answer(site: &Site, request: tiny_http::Request) {
    let get = matches!(request.method(), tiny_http::Method::Get | tiny_http::Method::Head);
    let found = if get { site.find(request.url()) } else { None };
    let file = found.and_then(|path| Some((std::fs::File::open(&path).ok()?, path)));
    let _ =
        match file {
            Some((file, path)) => {
                let response = tiny_http::Response::from_file(file).with_header(header("Content-Type", mime(&path)));
                // Names change with contents, but for the page and its worker.
                let changes = path.extension().is_some_and(|e| e == "html") || path.ends_with("worker.js");
                request.respond(response.with_header(header(
                    "Cache-Control",
                    if changes { "no-cache" } else { "max-age=31536000, immutable" },
                )))
            }
            None => request.respond(
                tiny_http::Response::from_string("There is no such file here.\n").with_status_code(if get {
                    404
                } else {
                    405
                }),
            ),
        };
}

fn header(name: &str, value: &str) -> tiny_http::Header {
    tiny_http::Header::from_bytes(name, value).expect("names and values of this file are ASCII")
}

fn mime(path: &Path) -> &'static str {
    visavis_tools::serve::mime(path)
}
