//! Service exceptions: what a WMS says instead of a map.

use super::version::Version;
use super::xml::escape;
use crate::cache::MakeError;
use crate::http::answer::{say_when, status_of};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

/// A refusal: a code of the standard where it has one, a line for people, and the status.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServiceException {
    code: Option<&'static str>,
    line: String,
    status: StatusCode,
}

impl ServiceException {
    /// The client's mistake.
    pub fn new(code: Option<&'static str>, line: impl Into<String>) -> Self {
        Self { code, line: line.into(), status: StatusCode::BAD_REQUEST }
    }

    /// A mistake in a parameter for which the standard has no code of its own.
    pub fn invalid(line: impl Into<String>) -> Self {
        Self::new(None, line)
    }

    /// The line for people.
    pub fn line(&self) -> &str {
        &self.line
    }

    /// The report as the version spells it.
    pub fn response(&self, version: Version) -> Response {
        let code = self.code.map(|code| format!(" code=\"{code}\"")).unwrap_or_default();
        let line = escape(&self.line);
        let (content_type, body) = match version {
            Version::V1_3_0 => (
                "text/xml",
                format!(
                    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ServiceExceptionReport version=\"1.3.0\" xmlns=\"http://www.opengis.net/ogc\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" xsi:schemaLocation=\"http://www.opengis.net/ogc http://schemas.opengis.net/wms/1.3.0/exceptions_1_3_0.xsd\">\n  <ServiceException{code}>{line}</ServiceException>\n</ServiceExceptionReport>\n"
                ),
            ),
            Version::V1_1_1 => (
                "application/vnd.ogc.se_xml",
                format!(
                    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!DOCTYPE ServiceExceptionReport SYSTEM \"http://schemas.opengis.net/wms/1.1.1/exception_1_1_1.dtd\">\n<ServiceExceptionReport version=\"1.1.1\">\n  <ServiceException{code}>{line}</ServiceException>\n</ServiceExceptionReport>\n"
                ),
            ),
        };
        let headers = [(header::CONTENT_TYPE, content_type), (header::CACHE_CONTROL, "no-store")];
        let mut response = (self.status, headers, body).into_response();
        say_when(&mut response);
        response
    }
}

impl From<String> for ServiceException {
    fn from(line: String) -> Self {
        Self::invalid(line)
    }
}

impl From<MakeError> for ServiceException {
    fn from(error: MakeError) -> Self {
        Self { code: None, line: error.to_string(), status: status_of(&error) }
    }
}
