//! `visavis live`: the live page's folder, served on this machine.

use super::print;
use clap::Args;
use std::net::TcpListener;
use std::path::PathBuf;
use std::sync::Arc;
use visavis::{Error, ErrorKind, Result};
use visavis_tools::serve::{Site, serve};

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
    let site = Arc::new(Site::open(&args.dir)?);
    let refused = |e: std::io::Error| {
        let message = format!("cannot listen on 127.0.0.1:{}: {e}; give another --port", args.port);
        Error::new(ErrorKind::Io, message)
    };
    let listener = TcpListener::bind(("127.0.0.1", args.port)).map_err(refused)?;
    let port = listener.local_addr().map_err(refused)?.port();
    print(&format!(
        "open    http://localhost:{port}/\nphone   adb reverse tcp:{port} tcp:{port}, then the same address there\nstop    Ctrl+C\n"
    ))?;
    serve(&listener, &site);
    Ok(())
}
