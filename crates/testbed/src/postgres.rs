//! A PostgreSQL server.

use std::env;
use std::fs;
use std::io;
use std::net::TcpListener;
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use tempfile::TempDir;

const PATIENCE: Duration = Duration::from_secs(60);

/// Whether writes reach the disk before they are answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Durability {
    /// As in a service: for measurements.
    Full,
    /// Quick; what is lost if the machine stops is a test's.
    None,
}

/// A PostgreSQL server of its own, with no password on a loopback port.
pub struct Postgres {
    programs: PathBuf,
    folder: TempDir,
    port: u16,
    durability: Durability,
    /// Whether it takes connections by TLS.
    encrypted: bool,
    server: Option<Child>,
    databases: AtomicU32,
}

impl Postgres {
    /// Makes and starts a server.
    ///
    /// # Panics
    /// If PostgreSQL is not installed (`scripts/install-prerequisites test` does
    /// it) or does not start.
    pub fn start(durability: Durability) -> Self {
        Self::start_as(durability, false, &env::temp_dir())
    }

    /// As [`Self::start`], with its files in a folder of its own below `place`.
    ///
    /// # Panics
    /// As [`Self::start`].
    pub fn start_in(durability: Durability, place: &Path) -> Self {
        Self::start_as(durability, false, place)
    }

    /// As [`Self::start`]; it also takes connections by TLS, as `localhost`.
    ///
    /// # Panics
    /// As [`Self::start`], and if there is no `openssl`.
    pub fn start_encrypted(durability: Durability) -> Self {
        Self::start_as(durability, true, &env::temp_dir())
    }

    fn start_as(durability: Durability, encrypted: bool, place: &Path) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let port = listener.local_addr().expect("its number").port();
        drop(listener);
        let folder = tempfile::tempdir_in(place).expect("a folder for PostgreSQL");
        let programs = programs();
        let databases = AtomicU32::new(0);
        let mut postgres =
            Self { programs, folder, port, durability, encrypted, server: None, databases };
        postgres.initialise();
        postgres.resume();
        postgres
    }

    /// A new, empty database's URL.
    pub fn database(&self) -> String {
        let name = format!("test_{}", self.databases.fetch_add(1, Ordering::Relaxed));
        self.sql("postgres", &format!("CREATE DATABASE {name}"));
        format!("postgres://postgres@127.0.0.1:{}/{name}", self.port)
    }

    /// The certificate by which a server that takes TLS proves who it is.
    pub fn certificate(&self) -> PathBuf {
        self.data().join("server.crt")
    }

    /// Runs statements in a database and returns what they print.
    pub fn sql(&self, database: &str, statements: &str) -> String {
        let port = self.port.to_string();
        let connection = ["-X", "-A", "-t", "-h", "127.0.0.1", "-U", "postgres", "-p", &port];
        let mut command = self.command("psql");
        let stop = ["-v", "ON_ERROR_STOP=1", "-d", database, "-c", statements];
        command.args(connection).args(stop);
        String::from_utf8_lossy(&succeed(command.output()).stdout).trim().to_owned()
    }

    /// Stops the server as at once as it can be stopped with nothing lost.
    pub fn stop(&mut self) {
        let Some(mut server) = self.server.take() else { return };
        // It ends when its input does.
        drop(server.stdin.take());
        let _ = server.wait();
    }

    /// Starts a stopped server again, on the same port.
    ///
    /// # Panics
    /// If it does not start.
    pub fn resume(&mut self) {
        // The shell outlives this process by as long as it takes to stop the server.
        let script = r#""$@" & trap : TERM INT; read -r _; kill -INT $!; wait $!"#;
        let mut command = self.unprivileged("sh");
        command.args(["-c", script, "sh"]).arg(self.programs.join("postgres"));
        command.arg("-D").arg(self.data());
        let port = format!("port={}", self.port);
        let fsync = match self.durability {
            Durability::Full => "fsync=on",
            Durability::None => "fsync=off",
        };
        let settings = [
            port.as_str(),
            fsync,
            "listen_addresses=127.0.0.1",
            "unix_socket_directories=",
            "max_connections=200",
        ];
        // The files' names are those of `certify`.
        let tls = self.encrypted.then_some("ssl=on");
        for setting in settings.into_iter().chain(tls) {
            command.args(["-c", setting]);
        }
        let log = fs::File::options().create(true).append(true).open(self.log()).expect("its log");
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(log);
        self.server = Some(command.spawn().expect("PostgreSQL starts"));
        let begun = Instant::now();
        while !self.answers() {
            assert!(begun.elapsed() < PATIENCE, "PostgreSQL does not start: {}", self.told());
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Whether it takes connections.
    pub fn answers(&self) -> bool {
        let port = self.port.to_string();
        let mut command = self.command("pg_isready");
        command.args(["-q", "-h", "127.0.0.1", "-p", &port]);
        command.status().is_ok_and(|status| status.success())
    }

    fn initialise(&self) {
        fs::set_permissions(self.folder.path(), fs::Permissions::from_mode(0o755))
            .expect("permissions of its folder");
        fs::create_dir(self.data()).expect("a folder for its data");
        if let Some((uid, gid)) = unprivileged() {
            chown(self.data(), Some(uid), Some(gid)).expect("a folder of its user");
        }
        let mut command = self.unprivileged(self.programs.join("initdb"));
        command.arg("-D").arg(self.data());
        command.args(["-U", "postgres", "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync"]);
        succeed(command.output());
        if self.encrypted {
            self.certify();
        }
    }

    /// Makes a certificate that signs itself.
    fn certify(&self) {
        let request = "[req]\ndistinguished_name=name\nx509_extensions=uses\nprompt=no\n\
                       [name]\nCN=localhost\n\
                       [uses]\nbasicConstraints=critical,CA:FALSE\nsubjectAltName=DNS:localhost\n";
        let config = self.folder.path().join("request.cnf");
        fs::write(&config, request).expect("a request for a certificate");
        let mut command = self.unprivileged("openssl");
        command.args(["req", "-x509", "-nodes", "-days", "2", "-newkey", "ec"]);
        command.args(["-pkeyopt", "ec_paramgen_curve:prime256v1", "-config"]).arg(config);
        command.arg("-keyout").arg(self.data().join("server.key"));
        command.arg("-out").arg(self.certificate());
        succeed(command.output());
    }

    fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    fn log(&self) -> PathBuf {
        self.folder.path().join("log")
    }

    fn told(&self) -> String {
        fs::read_to_string(self.log()).unwrap_or_default()
    }

    fn command(&self, program: &str) -> Command {
        Command::new(self.programs.join(program))
    }

    /// A command of a user whom the server does not refuse to run as.
    fn unprivileged(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new(program);
        command.current_dir(self.folder.path());
        if let Some((uid, gid)) = unprivileged() {
            command.uid(uid).gid(gid);
        }
        command
    }
}

impl Drop for Postgres {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Whom the server runs as in place of root: `postgres`, or else `nobody`.
fn unprivileged() -> Option<(u32, u32)> {
    if fs::metadata("/proc/self").is_ok_and(|own| own.uid() != 0) {
        return None;
    }
    let users = fs::read_to_string("/etc/passwd").unwrap_or_default();
    let find = |name| {
        let mut fields = users.lines().map(|line| line.split(':').collect::<Vec<_>>());
        let found = fields.find(|fields| fields.first() == Some(&name))?;
        Some((found.get(2)?.parse().ok()?, found.get(3)?.parse().ok()?))
    };
    Some(find("postgres").or_else(|| find("nobody")).expect("a user beside root"))
}

/// The folder of the server's programs: Debian keeps them out of the path.
fn programs() -> PathBuf {
    let mut found: Vec<(u32, PathBuf)> = fs::read_dir("/usr/lib/postgresql")
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter_map(|path| Some((path.file_name()?.to_str()?.parse().ok()?, path.join("bin"))))
        .filter(|(_, programs)| programs.join("postgres").exists())
        .collect();
    found.sort();
    if let Some((_, programs)) = found.pop() {
        return programs;
    }
    let told = succeed(Command::new("pg_config").arg("--bindir").output()).stdout;
    Path::new(String::from_utf8_lossy(&told).trim()).to_owned()
}

fn succeed(ended: io::Result<Output>) -> Output {
    let output = ended.expect("PostgreSQL is installed, see scripts/install-prerequisites");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}
