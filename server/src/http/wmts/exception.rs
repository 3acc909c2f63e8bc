//! Exception reports of OGC Web Services Common 1.1 (OGC 06-121r3).

use crate::cache::MakeError;
use crate::http::answer::{say_when, status_of};
use crate::http::wms::escape;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

/// A refusal: a code of the standard, the parameter that it is about, a line for people, and the status.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WmtsException {
    code: &'static str,
    locator: Option<&'static str>,
    line: String,
    status: StatusCode,
}

impl WmtsException {
    /// The client's mistake.
    pub fn new(code: &'static str, locator: Option<&'static str>, line: impl Into<String>) -> Self {
        Self { code, locator, line: line.into(), status: StatusCode::BAD_REQUEST }
    }

    /// The report.
    pub fn response(&self) -> Response {
        let locator = self.locator.map(|name| format!(" locator=\"{name}\"")).unwrap_or_default();
        let body = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ExceptionReport xmlns=\"http://www.opengis.net/ows/1.1\" version=\"1.0.0\" xml:lang=\"en\">\n  <Exception exceptionCode=\"{}\"{locator}><ExceptionText>{}</ExceptionText></Exception>\n</ExceptionReport>\n",
            self.code,
            escape(&self.line)
        );
        let headers = [(header::CONTENT_TYPE, "text/xml"), (header::CACHE_CONTROL, "no-store")];
        let mut response = (self.status, headers, body).into_response();
        say_when(&mut response);
        response
    }
}

impl From<MakeError> for WmtsException {
    fn from(error: MakeError) -> Self {
        Self { code: "NoApplicableCode", locator: None, line: error.to_string(), status: status_of(&error) }
    }
}
