//! What goes back to the browser.

use http_body_util::Full;
use hyper::body::Bytes;
use hyper::header::{HeaderName, HeaderValue};
use hyper::{Response, StatusCode};
use serde_json::json;

/// For every answer: nobody else's page may read it, frame it or guess its type, and nothing is kept.
const HEADERS: [(&str, &str); 5] = [
    ("cache-control", "no-store"),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cross-origin-opener-policy", "same-origin"),
];

/// What the page may do: run its own script and ask its own server.
const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
    connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// What a report may do, which anybody may have written: run its script, but as a page of no origin, without a network.
const REPORT_POLICY: &str = "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; \
    style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// An answer to a request.
#[derive(Debug)]
pub struct Answer {
    /// HTTP's.
    pub status: u16,
    /// What the browser has to take it for.
    pub content_type: &'static str,
    /// The policy that the browser holds a page to.
    pub policy: &'static str,
    /// The content.
    pub body: Vec<u8>,
}

impl Answer {
    /// JSON, as text.
    pub fn json(text: impl Into<Vec<u8>>) -> Self {
        Self { status: 200, content_type: "application/json", policy: PAGE_POLICY, body: text.into() }
    }

    /// A file of the page.
    pub fn file(content_type: &'static str, body: &[u8]) -> Self {
        Self { status: 200, content_type, policy: PAGE_POLICY, body: body.to_vec() }
    }

    /// A report.
    pub fn report(body: Vec<u8>) -> Self {
        Self { status: 200, content_type: "text/html; charset=utf-8", policy: REPORT_POLICY, body }
    }

    /// A refusal, with what the person should read.
    pub fn refusal(status: u16, why: &str) -> Self {
        Self { status, ..Self::json(json!({ "error": why }).to_string()) }
    }

    /// As hyper sends it.
    pub fn into_response(self) -> Response<Full<Bytes>> {
        let mut response = Response::new(Full::new(Bytes::from(self.body)));
        *response.status_mut() = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let own = [("content-type", self.content_type), ("content-security-policy", self.policy)];
        for (name, value) in own.into_iter().chain(HEADERS) {
            response.headers_mut().insert(HeaderName::from_static(name), HeaderValue::from_static(value));
        }
        response
    }
}
