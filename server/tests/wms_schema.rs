//! What WMS writes is valid by the standard's schemas, where those are at hand.

mod common;

use common::{Kind, app_with, get};
use std::path::{Path, PathBuf};
use std::process::Command;
use treeline_server::config::Config;
use treeline_server::http::router;

/// The schemas' folder and xmllint, or a word why there is nothing to check with.
fn schemas() -> Option<PathBuf> {
    let data = std::env::var_os("TREELINE_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    let folder = data.join("ogc-schemas");
    if !folder.is_dir() {
        eprintln!("skipped: no schemas in {}", folder.display());
        return None;
    }
    if Command::new("xmllint").arg("--version").output().is_err() {
        eprintln!("skipped: xmllint is not installed");
        return None;
    }
    Some(folder)
}

/// A copy of the schemas that name each other, and not their addresses: nothing is fetched.
fn local(folder: &Path) -> tempfile::TempDir {
    let copy = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path)
            .unwrap()
            .replace("http://www.w3.org/1999/xlink.xsd", "xlink.xsd")
            .replace("http://www.w3.org/2001/xml.xsd", "xml.xsd");
        std::fs::write(copy.path().join(path.file_name().unwrap()), text).unwrap();
    }
    copy
}

fn assert_valid(arguments: &[&str], document: &str) {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), document).unwrap();
    let output = Command::new("xmllint")
        .args(["--nonet", "--noout"])
        .args(arguments)
        .arg(file.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}\n{document}", String::from_utf8_lossy(&output.stderr));
}

#[tokio::test]
async fn documents_are_valid_by_their_schemas() {
    let Some(folder) = schemas() else { return };
    let schemas = local(&folder);
    let schema = |name: &str| schemas.path().join(name).to_string_lossy().into_owned();
    let router = router(app_with(Kind { epsg: Some(31287), ..Kind::default() }, &Config::default()).0);
    for (request, new, old) in [
        ("GetCapabilities", "capabilities_1_3_0.xsd", "capabilities_1_1_1.dtd"),
        ("GetMap", "exceptions_1_3_0.xsd", "exception_1_1_1.dtd"),
        ("%3Cscript%3E%01", "exceptions_1_3_0.xsd", "exception_1_1_1.dtd"),
    ] {
        let of = |version: &str| format!("/wms?SERVICE=WMS&REQUEST={request}&VERSION={version}");
        assert_valid(&["--schema", &schema(new)], &get(&router, &of("1.3.0")).await.text());
        let text = get(&router, &of("1.1.1")).await.text();
        let address = format!("http://schemas.opengis.net/wms/1.1.1/{old}");
        assert!(text.contains(&address), "{text}");
        assert_valid(&["--valid"], &text.replace(&address, &schema(old)));
    }
}
