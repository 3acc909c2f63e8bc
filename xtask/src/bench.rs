//! `cargo xtask bench`: runs every benchmark of the workspace.
//!
//! A benchmark is a bench target without the built-in harness. It prints one JSON object a line,
//! `{"name": …, "value": …, "unit": …}`; other lines are passed on.

use crate::{bundle, process};
use anyhow::Context;
use serde_json::{Value, json};

/// Builds and runs the benchmarks in release; JSON into docs/report/bench.json, and a table.
pub fn run() -> anyhow::Result<()> {
    bundle::build()?; // the server embeds the page, and a benchmark opens it
    process::check(&mut process::cargo(&["build", "--locked", "--release", "--bins"]))?;
    let metadata = process::metadata(false)?;
    let mut results = Vec::new();
    for (package, bench) in targets(&metadata) {
        println!("\n=== {package}: {bench}");
        let output = process::output(&mut process::cargo(&[
            "bench",
            "--locked",
            "--package",
            &package,
            "--bench",
            &bench,
        ]))?;
        for line in output.lines() {
            match measurement(line) {
                Some(mut result) => {
                    result["bench"] = json!(bench);
                    results.push(result);
                }
                None => println!("{line}"),
            }
        }
    }
    println!("\n{:<24} {:<44} {:>12} unit", "bench", "what", "value");
    for result in &results {
        println!(
            "{:<24} {:<44} {:>12.3} {}",
            result["bench"].as_str().unwrap_or_default(),
            result["name"].as_str().unwrap_or_default(),
            result["value"].as_f64().unwrap_or_default(),
            result["unit"].as_str().unwrap_or_default()
        );
    }
    let path = process::root().join("docs/report/bench.json");
    let text = serde_json::to_string_pretty(&json!({ "results": results })).context("JSON")? + "\n";
    process::write_if_changed(&path, text.as_bytes())?;
    println!("\nwritten to {}", path.display());
    Ok(())
}

/// Package and name of every bench target.
fn targets(metadata: &Value) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for package in metadata["packages"].as_array().into_iter().flatten() {
        for target in package["targets"].as_array().into_iter().flatten() {
            let is_bench = target["kind"].as_array().is_some_and(|kinds| kinds.contains(&json!("bench")));
            if let (true, Some(package), Some(name)) =
                (is_bench, package["name"].as_str(), target["name"].as_str())
            {
                found.push((package.to_owned(), name.to_owned()));
            }
        }
    }
    found
}

/// A line that is a measurement.
fn measurement(line: &str) -> Option<Value> {
    let value: Value = serde_json::from_str(line).ok()?;
    (value["name"].is_string() && value["value"].is_number() && value["unit"].is_string()).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measurements_and_other_lines() {
        assert!(measurement(r#"{"name": "tile", "value": 3.5, "unit": "ms"}"#).is_some());
        assert!(measurement(r#"{"name": "tile"}"#).is_none());
        assert!(measurement("Running benches/x.rs").is_none());
    }

    #[test]
    fn bench_targets_are_found() {
        let metadata = json!({"packages": [{"name": "a", "targets": [
            {"kind": ["lib"], "name": "a"}, {"kind": ["bench"], "name": "tiles"}]}]});
        assert_eq!(targets(&metadata), [("a".to_owned(), "tiles".to_owned())]);
    }
}
