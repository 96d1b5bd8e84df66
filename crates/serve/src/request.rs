//! What may be asked, by whom, and what answers it.

use std::net::IpAddr;

use serde_json::json;

use crate::answer::Answer;
use crate::folder::{Folder, Place, Refusal};
use crate::{metrics, page, summary};

/// Of a request, what decides the answer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Request<'a> {
    /// `GET` and so on.
    pub method: &'a str,
    /// Path and query, as they were sent.
    pub target: &'a str,
    /// The header `Host`: whom the browser believes to talk to.
    pub host: Option<&'a str>,
    /// The header `Origin`: which page asks, where the browser says so.
    pub origin: Option<&'a str>,
    /// The header `Sec-Fetch-Site`: how that page relates to ours.
    pub fetch_site: Option<&'a str>,
}

/// More of a file is not handed out [bytes].
const MAX_EVAL_BYTES: u64 = 16 << 20;
const MAX_TRAJECTORY_BYTES: u64 = 128 << 20;
const MAX_REPORT_BYTES: u64 = 128 << 20;

/// The answer to a request. `hint` is what to type for a first run.
pub fn answer(request: &Request<'_>, folder: &Folder, hint: &str) -> Answer {
    if let Some(refusal) = refuse_stranger(request) {
        return refusal;
    }
    let (path, query) = request.target.split_once('?').unwrap_or((request.target, ""));
    let parameter = |name| parameter(query, name);
    let run = || folder.run(&parameter("run").unwrap_or_default());
    let result = match path {
        "/api/runs" => return Answer::json(listing(folder, hint)),
        "/api/metrics" => run().and_then(|run| {
            let from = parameter("from").and_then(|from| from.parse().ok()).unwrap_or(0);
            Ok(Answer::json(metrics::since(&run, from)?))
        }),
        "/api/eval" => run().and_then(|run| json_file(&run, "eval.json", MAX_EVAL_BYTES)),
        "/api/trajectory" => run().and_then(|run| {
            let name = parameter("name").unwrap_or_default();
            json_file(&run, &format!("trajectories/{name}.json"), MAX_TRAJECTORY_BYTES)
        }),
        "/report" => folder
            .place(&parameter("run").unwrap_or_default())
            .and_then(|reported| reported.read("report.html", MAX_REPORT_BYTES))
            .map(Answer::report),
        _ => return page::answer(path),
    };
    result.unwrap_or_else(|refusal| Answer::refusal(refusal.status(), &refusal.to_string()))
}

/// Everything but a person's own browser, on this page, is turned away.
///
/// A page of another origin cannot read our answers, but it could send requests. And a name that somebody lets point to
/// this machine (DNS rebinding) would make another page's origin ours; so only addresses and `localhost` are names of ours.
fn refuse_stranger(request: &Request<'_>) -> Option<Answer> {
    if !matches!(request.method, "GET" | "HEAD") {
        return Some(Answer::refusal(405, "this server only shows; ask with GET"));
    }
    let Some(host) = request.host.filter(|host| is_own_name(host)) else {
        return Some(Answer::refusal(
            421,
            "open this page by an address of this machine in numbers, as `canter serve` has printed it, or by localhost",
        ));
    };
    let is_foreign = request.origin.is_some_and(|origin| origin != format!("http://{host}"));
    // A link to the page from elsewhere is fine; what it shows is then asked for by the page itself.
    let is_page = request.target == "/";
    let is_cross = request.fetch_site.is_some_and(|site| !matches!(site, "same-origin" | "none"));
    if is_foreign || (is_cross && !is_page) {
        return Some(Answer::refusal(403, "another page may not ask this server"));
    }
    None
}

/// Whether a `Host` is `localhost` or an address, with or without a port.
fn is_own_name(host: &str) -> bool {
    let without_port = match host.rsplit_once(':') {
        Some((name, port)) if !port.is_empty() && port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let address = without_port.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or(without_port);
    without_port.eq_ignore_ascii_case("localhost") || address.parse::<IpAddr>().is_ok()
}

/// The first value of a query's parameter.
fn parameter(query: &str, name: &str) -> Option<String> {
    let mut pairs = form_urlencoded::parse(query.as_bytes());
    pairs.find(|(key, _)| key == name).map(|(_, value)| value.into_owned())
}

/// All runs and reports as JSON.
fn listing(folder: &Folder, hint: &str) -> String {
    let found = folder.list();
    let runs: Vec<_> = found.runs.iter().map(summary::of).collect();
    json!({
        "folder": folder.name(),
        "hint": hint,
        "runs": runs,
        "reports": found.reports,
        "left_out": found.left_out,
    })
    .to_string()
}

/// A JSON file as it is. What is no JSON is refused, so that the page can rely on it.
fn json_file(run: &Place, name: &str, max_bytes: u64) -> Result<Answer, Refusal> {
    let bytes = run.read(name, max_bytes)?;
    let text =
        std::str::from_utf8(&bytes).map_err(|_| Refusal::NotJson(name.to_owned(), "it is no text".to_owned()))?;
    serde_json::from_str::<serde::de::IgnoredAny>(text)
        .map_err(|error| Refusal::NotJson(name.to_owned(), error.to_string()))?;
    Ok(Answer::json(bytes))
}
