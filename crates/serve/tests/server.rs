//! The server, asked as a browser asks it, and as others might.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use canter_serve::Server;
use serde_json::{Value, json};

const CONFIG: &str = "robot = \"doggo\"\nseed = 7\n[training]\nmax_env_steps = 1000\n";
const EVAL: &str = r#"{"protocol": {"num_episodes": 20}, "policy": {"speed_m_per_s": 2.0, "falls": 1},
    "default_gait": "sine", "default_speed_m_per_s": 0.5, "speed_ratio": 4.0, "speed_ratio_ci": [3.5, 4.5]}"#;

/// A folder of runs, served until this is dropped.
struct Served {
    folder: PathBuf,
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    server: Option<JoinHandle<()>>,
}

struct Response {
    status: u16,
    head: String,
    body: String,
}

impl Response {
    fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap_or_else(|error| panic!("{error}: {}", self.body))
    }

    fn header(&self, name: &str) -> &str {
        let lines = self.head.lines().filter_map(|line| line.split_once(": "));
        lines.into_iter().find(|(key, _)| key.eq_ignore_ascii_case(name)).map_or("", |(_, value)| value)
    }
}

impl Served {
    fn new(name: &str) -> Self {
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(folder.join("runs")).unwrap();
        let server = Server::bind(&folder.join("runs"), Ipv4Addr::LOCALHOST.into(), 0, "canter train").unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let (address, shared) = (server.address(), stop.clone());
        let server = thread::spawn(move || server.run(&shared).unwrap());
        Self { folder, address, stop, server: Some(server) }
    }

    /// A run with a configuration and nothing else.
    fn add_run(&self, id: &str) -> PathBuf {
        let run = self.folder.join("runs").join(id);
        fs::create_dir_all(&run).unwrap();
        fs::write(run.join("config.toml"), CONFIG).unwrap();
        fs::write(run.join("lock"), "").unwrap();
        run
    }

    /// `headers` begin with `Host`.
    fn ask(&self, method: &str, target: &str, headers: &[(&str, &str)]) -> Response {
        let mut stream = TcpStream::connect(self.address).unwrap();
        let headers: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
        write!(stream, "{method} {target} HTTP/1.1\r\nConnection: close\r\n{headers}\r\n").unwrap();
        let mut response = String::new();
        stream.read_to_string(&mut response).unwrap();
        let (head, body) = response.split_once("\r\n\r\n").unwrap();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        Response { status, head: head.to_owned(), body: body.to_owned() }
    }

    fn get(&self, target: &str) -> Response {
        self.ask("GET", target, &[("Host", &self.address.to_string())])
    }

    fn listing(&self) -> Value {
        self.get("/api/runs").json()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.server.take().map(JoinHandle::join);
    }
}

fn ids(listing: &Value) -> Vec<&str> {
    let mut ids: Vec<&str> =
        listing["runs"].as_array().unwrap().iter().map(|run| run["id"].as_str().unwrap()).collect();
    ids.sort_unstable();
    ids
}

#[test]
fn runs_are_listed_with_what_they_are_up_to() {
    let served = Served::new("listing");
    let empty = served.listing();
    assert_eq!((&empty["runs"], &empty["hint"]), (&json!([]), &json!("canter train")));

    let finished = served.add_run("finished");
    fs::write(finished.join("eval.json"), EVAL).unwrap();
    fs::create_dir(finished.join("trajectories")).unwrap();
    for name in ["a.json", "learned.json", "sine.json", "learned.json.tmp"] {
        fs::write(finished.join("trajectories").join(name), "{}").unwrap();
    }
    served.add_run("sweep-1/points/stopped");
    let training = served.add_run("training");
    let lines = "{\"env_steps\": 500, \"speed_m_per_s\": 0.25, \"episode_return\": null}\n{\"env_st";
    fs::write(training.join("metrics.jsonl"), lines).unwrap();
    let lock = File::open(training.join("lock")).unwrap();
    lock.try_lock().unwrap();
    fs::write(served.folder.join("runs/sweep-1/sweep.json"), "{}").unwrap();
    fs::write(served.folder.join("runs/sweep-1/report.html"), "<p>").unwrap();

    let listing = served.listing();
    assert_eq!(ids(&listing), ["finished", "sweep-1/points/stopped", "training"]);
    assert_eq!(listing["reports"], json!([{"id": "sweep-1", "kind": "sweep"}]));
    let run = |id: &str| listing["runs"].as_array().unwrap().iter().find(|run| run["id"] == id).unwrap().clone();
    let finished = run("finished");
    assert_eq!(
        (&finished["state"], &finished["seed"], &finished["robot"]),
        (&json!("finished"), &json!(7), &json!("doggo"))
    );
    assert_eq!((&finished["verdict"]["ratio"], &finished["verdict"]["ratio_ci"]), (&json!(4.0), &json!([3.5, 4.5])));
    assert_eq!(finished["trajectories"], json!(["learned", "a", "sine"]));
    assert_eq!(run("sweep-1/points/stopped")["state"], "stopped");
    let training = run("training");
    assert_eq!((&training["state"], &training["env_steps"]), (&json!("training"), &json!(500.0)));
    assert_eq!((&training["max_env_steps"], &training["episode_return"]), (&json!(1000), &Value::Null));

    lock.unlock().unwrap();
    let listing = served.listing();
    let states: Vec<&Value> = listing["runs"].as_array().unwrap().iter().map(|run| &run["state"]).collect();
    assert!(!states.contains(&&json!("training")), "{states:?}");
}

#[test]
fn metrics_come_as_they_are_written() {
    let served = Served::new("metrics");
    let run = served.add_run("a b&c");
    let ask = |from: u64| served.get(&format!("/api/metrics?run=a+b%26c&from={from}")).json();
    assert_eq!(ask(0), json!({"from": 0, "next": 0, "more": false, "broken": 0, "lines": []}));

    let mut file = File::create(run.join("metrics.jsonl")).unwrap();
    file.write_all(b"{\"iteration\": 1}\n{\"iter").unwrap();
    let first = ask(0);
    assert_eq!((&first["lines"], &first["next"]), (&json!([{"iteration": 1}]), &json!(17)));
    file.write_all(b"ation\": 2}\n").unwrap();
    assert_eq!(ask(17)["lines"], json!([{"iteration": 2}]));
    // A resume from an earlier checkpoint cuts the file.
    file.set_len(17).unwrap();
    assert_eq!(ask(34), first);
}

#[test]
fn files_are_handed_out_as_they_are() {
    let served = Served::new("files");
    let run = served.add_run("one");
    fs::create_dir(run.join("trajectories")).unwrap();
    fs::write(run.join("eval.json"), EVAL).unwrap();
    fs::write(run.join("trajectories/learned.json"), "[1.50]").unwrap();
    fs::write(run.join("report.html"), "<h1>hello").unwrap();
    for target in ["/report", "/report?run=", "/api/eval", "/api/metrics?from=0"] {
        assert_eq!(served.get(target).status, 404, "{target}");
    }
    assert_eq!(served.get("/api/eval?run=one").body, EVAL);
    assert_eq!(served.get("/api/trajectory?run=one&name=learned").body, "[1.50]");
    let report = served.get("/report?run=one");
    assert_eq!((report.status, report.body.as_str()), (200, "<h1>hello"));
    assert!(report.header("Content-Security-Policy").starts_with("sandbox allow-scripts; default-src 'none'"));
    let page = served.get("/");
    assert_eq!(page.status, 200);
    assert!(page.body.starts_with("<!doctype html>"), "{}", page.body);
    assert!(page.header("Content-Security-Policy").contains("frame-ancestors 'none'"));
    assert_eq!(page.header("X-Content-Type-Options"), "nosniff");
}

#[test]
fn a_run_directory_can_be_served_alone() {
    let served = Served::new("alone");
    served.add_run("");
    assert_eq!(ids(&served.listing()), ["."]);
    assert_eq!(served.get("/api/metrics?run=.").json()["lines"], json!([]));
}

#[test]
fn strangers_are_refused() {
    let served = Served::new("strangers");
    let port = served.address.port();
    let own = served.address.to_string();
    let status = |headers: &[(&str, &str)]| served.ask("GET", "/api/runs", headers).status;
    for host in [own.clone(), format!("localhost:{port}"), format!("[::1]:{port}"), format!("192.168.1.2:{port}")] {
        assert_eq!(status(&[("Host", &host)]), 200, "{host}");
    }
    for host in ["evil.example", &format!("evil.example:{port}"), &format!("localhost.evil.example:{port}"), "", ":80"]
    {
        assert_eq!(status(&[("Host", host)]), 421, "{host}");
    }
    assert_eq!(status(&[]), 421);
    for origin in ["http://evil.example", "null", &format!("https://{own}"), &format!("http://localhost:{port}")] {
        assert_eq!(status(&[("Host", &own), ("Origin", origin)]), 403, "{origin}");
    }
    assert_eq!(status(&[("Host", &own), ("Origin", &format!("http://{own}"))]), 200);
    for site in ["cross-site", "same-site"] {
        assert_eq!(status(&[("Host", &own), ("Sec-Fetch-Site", site)]), 403, "{site}");
        // A link to the page may stand anywhere.
        assert_eq!(served.ask("GET", "/", &[("Host", &own), ("Sec-Fetch-Site", site)]).status, 200);
    }
    for method in ["POST", "PUT", "DELETE", "OPTIONS"] {
        assert_eq!(served.ask(method, "/api/runs", &[("Host", &own)]).status, 405, "{method}");
    }
}

#[test]
fn nothing_outside_of_the_folder_is_shown() {
    let served = Served::new("outside");
    let run = served.add_run("one");
    let secret = served.folder.join("secret");
    fs::create_dir_all(secret.join("trajectories")).unwrap();
    for name in ["config.toml", "lock", "eval.json", "report.html", "trajectories/learned.json", "metrics.jsonl"] {
        fs::write(secret.join(name), "\"SECRET\"\n").unwrap();
    }
    link(&secret, &served.folder.join("runs/linked"));
    link(&secret.join("eval.json"), &run.join("eval.json"));
    link(&secret.join("metrics.jsonl"), &run.join("metrics.jsonl"));
    link(&secret.join("report.html"), &run.join("report.html"));
    link(&secret.join("trajectories"), &run.join("trajectories"));

    let absolute = secret.display().to_string();
    let names =
        ["../secret", "..%2Fsecret", "one/../../secret", "linked", &absolute, "./../secret", "one%00", "..", "%FF"];
    for name in names {
        for target in ["/api/eval?run=", "/api/metrics?run=", "/report?run=", "/api/trajectory?name=learned&run="] {
            let response = served.get(&format!("{target}{name}"));
            assert!(matches!(response.status, 403 | 404), "{target}{name}: {} {}", response.status, response.body);
            assert!(!response.body.contains("SECRET"));
        }
    }
    let targets = [
        "/api/eval?run=one",
        "/api/metrics?run=one",
        "/report?run=one",
        "/api/trajectory?run=one&name=learned",
        "/api/trajectory?run=one&name=../config",
        "/api/trajectory?run=one&name=../../../secret/trajectories/learned",
        "/../secret/eval.json",
        "/assets/../../secret/eval.json",
        "/one/config.toml",
    ];
    for target in targets {
        let response = served.get(target);
        assert!(matches!(response.status, 403 | 404), "{target}: {} {}", response.status, response.body);
        assert!(!response.body.contains("SECRET"));
    }
    let listing = served.listing();
    assert_eq!(ids(&listing), ["one"]);
    assert!(!listing.to_string().contains("SECRET"), "{listing}");
    assert_eq!(listing["runs"][0]["trajectories"], json!([]));
    let left_out = listing["left_out"][0].as_str().unwrap();
    assert!(left_out.ends_with("/linked: a link"), "{left_out}");
}

#[test]
fn files_that_hurt_are_said_to() {
    let served = Served::new("hostile");
    let run = served.add_run("<img src=x onerror=alert(1)>");
    fs::write(run.join("config.toml"), "robot = \"<script>\"\nseed = \"many\"\n[training]\nmax_env_steps = nan\n")
        .unwrap();
    fs::write(run.join("metrics.jsonl"), "{\"env_steps\": \"<b>\", \"speed_m_per_s\": {}}\n").unwrap();
    fs::write(run.join("eval.json"), "[".repeat(100_000)).unwrap();
    let other = served.add_run("other");
    fs::write(other.join("config.toml"), [0xff, 0xfe]).unwrap();
    fs::write(other.join("eval.json"), "{\"policy\": {\"falls\": []}, \"speed_ratio_ci\": [1, \"<i>\", null]}")
        .unwrap();
    let pipe = served.add_run("pipe");
    fs::remove_file(pipe.join("lock")).unwrap();
    fs::write(pipe.join("metrics.jsonl"), "").unwrap();
    let made = std::process::Command::new("mkfifo").arg(pipe.join("eval.json")).arg(pipe.join("lock")).status();
    assert!(made.unwrap().success());

    let listing = served.listing();
    assert_eq!(ids(&listing), ["<img src=x onerror=alert(1)>", "other", "pipe"]);
    let of = |id: &str| listing["runs"].as_array().unwrap().iter().find(|run| run["id"] == id).unwrap().clone();
    let run = of("<img src=x onerror=alert(1)>");
    assert_eq!((&run["robot"], &run["seed"], &run["env_steps"]), (&json!("<script>"), &Value::Null, &Value::Null));
    assert!(run["problems"][0].as_str().unwrap().starts_with("eval.json: recursion limit"), "{}", run["problems"]);
    let other = of("other");
    assert_eq!(other["problems"], json!(["config.toml: it is no text"]));
    assert_eq!((&other["verdict"]["falls"], &other["verdict"]["ratio_ci"]), (&Value::Null, &Value::Null));
    assert_eq!(of("pipe")["problems"], json!(["eval.json: this is no ordinary file"]));

    let response = served.get("/api/eval?run=%3Cimg+src%3Dx+onerror%3Dalert%281%29%3E");
    assert_eq!((response.status, response.header("Content-Type")), (422, "application/json"));
    assert_eq!(served.get("/api/eval?run=pipe").status, 500);
}

/// Sends these bytes and reads nothing.
fn send(address: SocketAddr, bytes: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.write_all(bytes.as_bytes()).unwrap();
    stream
}

#[test]
fn nobody_can_hold_it_up() {
    let served = Served::new("stalling");
    let run = served.add_run("one");
    fs::write(run.join("report.html"), vec![b' '; 60 << 20]).unwrap();
    let host = format!("Host: {}\r\n", served.address);
    let requests = [
        // Nothing, half a head, a body that does not come, one that no memory has.
        String::new(),
        format!("GET / HTTP/1.1\r\n{host}"),
        format!("POST /api/runs HTTP/1.1\r\n{host}Content-Length: 5000\r\n\r\n"),
        format!("GET /api/runs HTTP/1.1\r\n{host}Content-Length: {}\r\n\r\n", 1_u64 << 60),
        format!("GET /api/runs HTTP/1.1\r\n{host}Content-Length: {}\r\n\r\n", u64::MAX),
        format!("GET /api/runs HTTP/1.1\r\n{host}Transfer-Encoding: chunked\r\n\r\nffffffff\r\n"),
        // An answer that nobody reads.
        format!("GET /report?run=one HTTP/1.1\r\n{host}\r\n"),
        "\u{1}\u{2}\u{3}\r\n\r\n".to_owned(),
    ];
    let held: Vec<TcpStream> = (0..8).flat_map(|_| &requests).map(|request| send(served.address, request)).collect();
    for _ in 0..20 {
        assert_eq!(served.get("/api/runs").status, 200);
    }
    let long = format!("/{}", "x".repeat(100_000));
    let mut stream = send(served.address, &format!("GET {long} HTTP/1.1\r\n{host}\r\n"));
    let mut answer = String::new();
    let _ = stream.read_to_string(&mut answer);
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 4"), "{answer}");
    assert_eq!(served.get("/api/runs").status, 200);
    // It ends while all of them still wait.
    drop(served);
    drop(held);
}

#[test]
fn an_address_that_is_meant_for_a_proxy_is_nobodys() {
    let served = Served::new("proxy");
    let target = format!("http://{}/api/runs", served.address);
    assert_eq!(served.ask("GET", &target, &[("Host", "evil.example")]).status, 421);
    assert_eq!(served.ask("GET", &target, &[("Host", &served.address.to_string())]).status, 404);
}

#[test]
fn of_too_many_runs_the_newest_are_listed() {
    let served = Served::new("many");
    for number in 0..1003 {
        let run = served.add_run(&format!("run{number}"));
        let time = std::time::SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000 + number);
        File::options().write(true).open(run.join("config.toml")).unwrap().set_modified(time).unwrap();
    }
    let listing = served.listing();
    let listed: Vec<&str> = listing["runs"].as_array().unwrap().iter().map(|run| run["id"].as_str().unwrap()).collect();
    assert_eq!((listed.len(), listed[0], listed[999]), (1000, "run1002", "run3"));
    assert_eq!(listing["left_out"], json!(["3 older runs"]));
}

#[test]
fn a_server_that_cannot_be_says_why() {
    let served = Served::new("twice");
    let bind = |folder: &Path, port| {
        let host: IpAddr = Ipv4Addr::LOCALHOST.into();
        Server::bind(folder, host, port, "").map(|_| ()).unwrap_err().to_string()
    };
    let message = bind(&served.folder, served.address.port());
    assert!(message.contains("Choose another port with --port"), "{message}");
    let message = bind(&served.folder.join("missing"), 0);
    assert!(message.contains("missing") && message.contains("name the folder"), "{message}");
    let file = served.folder.join("file");
    fs::write(&file, "").unwrap();
    assert!(bind(&file, 0).contains("is no folder"));
}

fn link(to: &Path, at: &Path) {
    std::os::unix::fs::symlink(to, at).unwrap();
}
