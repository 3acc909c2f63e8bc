//! How links start: `--public-url`, else what the request's headers say of the way it came.

use axum::http::{HeaderMap, header};

/// The start of links, without a slash at the end; empty where nothing is known (links are then
/// relative to the server's root).
pub fn base_url(public_url: Option<&str>, headers: &HeaderMap) -> String {
    if let Some(url) = public_url {
        return url.to_owned();
    }
    let text = |name: &str| headers.get(name).and_then(|value| value.to_str().ok());
    let forwarded = |key: &str| {
        // RFC 7239: the first element is the proxy nearest to the client.
        let first = text("forwarded")?.split(',').next()?;
        let pair = first.split(';').find_map(|pair| {
            let (name, value) = pair.trim().split_once('=')?;
            name.eq_ignore_ascii_case(key).then_some(value)
        })?;
        Some(pair.trim_matches('"'))
    };
    let first = |name: &str| text(name)?.split(',').next().map(str::trim);
    let host = [forwarded("host"), first("x-forwarded-host"), text(header::HOST.as_str())]
        .into_iter()
        .flatten()
        .find(|host| is_authority(host));
    let Some(host) = host else { return String::new() };
    let scheme = [forwarded("proto"), first("x-forwarded-proto")]
        .into_iter()
        .flatten()
        .find(|scheme| matches!(*scheme, "http" | "https"))
        .unwrap_or("http");
    let prefix = first("x-forwarded-prefix").filter(|prefix| is_path(prefix)).unwrap_or("");
    format!("{scheme}://{host}{}", prefix.trim_end_matches('/'))
}

/// Host and port, with nothing in it that could break out of a link.
fn is_authority(host: &str) -> bool {
    !host.is_empty() && host.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".-_:[]".contains(&byte))
}

fn is_path(path: &str) -> bool {
    path.starts_with('/')
        && !path.starts_with("//")
        && path.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".-_~/".contains(&byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn base(headers: &[(&'static str, &str)]) -> String {
        let headers =
            headers.iter().map(|&(name, value)| (name.parse().unwrap(), value.parse().unwrap())).collect();
        base_url(None, &headers)
    }

    #[test]
    fn the_way_that_the_request_came() {
        assert_eq!(base(&[("host", "localhost:8080")]), "http://localhost:8080");
        assert_eq!(
            base(&[
                ("host", "inner"),
                ("x-forwarded-host", "a.org, b"),
                ("x-forwarded-proto", "https"),
                ("x-forwarded-prefix", "/maps/")
            ]),
            "https://a.org/maps"
        );
        assert_eq!(
            base(&[("host", "inner"), ("forwarded", "for=1.2.3.4;proto=https;host=\"a.org:444\"")]),
            "https://a.org:444"
        );
        assert_eq!(base(&[]), "");
    }

    #[test]
    fn headers_that_lie_are_passed_over() {
        assert_eq!(
            base(&[("host", "ok"), ("x-forwarded-host", "a\"><script"), ("x-forwarded-proto", "javascript")]),
            "http://ok"
        );
        assert_eq!(base(&[("host", "ok"), ("x-forwarded-prefix", "//evil.org")]), "http://ok");
    }

    #[test]
    fn the_public_url_wins() {
        let headers = [("host".parse().unwrap(), "inner".parse().unwrap())].into_iter().collect();
        assert_eq!(base_url(Some("https://x.org/y"), &headers), "https://x.org/y");
    }
}
