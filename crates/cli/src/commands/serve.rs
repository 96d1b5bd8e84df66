//! `canter serve`.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::Path;
use std::process::ExitCode;

use canter_serve::Server;

use crate::args::ServeArgs;
use crate::error::CliError;
use crate::interrupt::Interrupt;
use crate::output::{complain, program, say};

/// Where `canter train` puts its runs.
const RUNS: &str = "runs";

/// `canter serve`.
pub fn serve(args: &ServeArgs) -> Result<ExitCode, CliError> {
    let folder = args.folder.as_deref().unwrap_or(Path::new(RUNS));
    if args.folder.is_none() {
        // The page may be opened before the first training.
        std::fs::create_dir_all(folder).map_err(|error| CliError::File(RUNS.to_owned(), error))?;
    }
    let interrupt = Interrupt::listen("")?;
    let server = Server::bind(folder, args.host, args.port, &format!("{} train", program()))?;
    if !canter_serve::is_built() {
        complain("warning: this canter was built without its page; the address below says how to get it");
    }
    if !args.host.is_loopback() {
        complain("warning: every machine that reaches this one can read these runs, by this one's address in numbers");
    }
    say(&format!("{} is served at http://{}/ until Ctrl-C", folder.display(), reachable(server.address())));
    server.run(&interrupt.stop)?;
    Ok(ExitCode::SUCCESS)
}

/// An address that a browser on this machine can open.
fn reachable(address: SocketAddr) -> SocketAddr {
    let ip = match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, address.port())
}
