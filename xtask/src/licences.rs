//! `cargo xtask licences`: whose work is in the programs and the page, and under what terms.

use crate::process;
use anyhow::{Context, bail};
use std::collections::{BTreeMap, BTreeSet};

/// Licences that code in the programs may have: permissive, and without conditions beyond naming
/// the authors.
const ALLOWED: [&str; 12] = [
    "MIT",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "Zlib",
    "0BSD",
    "BSL-1.0",
    "CC0-1.0",
    "Unicode-3.0",
    // The Independent JPEG Group's, of a kind with BSD; libjpeg-turbo has it, too.
    "IJG",
];

/// Writes THIRD-PARTY.md; fails where a dependency has no allowed licence.
pub fn write() -> anyhow::Result<()> {
    process::write_if_changed(&process::root().join("THIRD-PARTY.md"), notices()?.as_bytes())
}

/// Fails where a dependency has no allowed licence, or THIRD-PARTY.md is not what [`write`] would write.
pub fn check() -> anyhow::Result<()> {
    let path = process::root().join("THIRD-PARTY.md");
    let there = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    if there != notices()? {
        bail!("THIRD-PARTY.md is not up to date; `cargo xtask licences` writes it");
    }
    println!("THIRD-PARTY.md is up to date, all licences are allowed");
    Ok(())
}

/// A package from a registry.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Package {
    name: String,
    version: String,
    licence: String,
    repository: String,
}

/// The text of THIRD-PARTY.md.
fn notices() -> anyhow::Result<String> {
    let metadata = process::metadata(true)?;
    let mut groups: BTreeMap<String, BTreeSet<Package>> = BTreeMap::new();
    let mut refused = Vec::new();
    for package in metadata["packages"].as_array().context("cargo metadata lists no packages")? {
        if package["source"].is_null() {
            continue; // a member of the workspace
        }
        let text = |key: &str| package[key].as_str().unwrap_or_default().to_owned();
        let package = Package {
            name: text("name"),
            version: text("version"),
            licence: text("license").replace('/', " OR "),
            repository: text("repository"),
        };
        if is_allowed(&package.licence) {
            groups.entry(package.licence.clone()).or_default().insert(package);
        } else {
            refused.push(format!("{} {} ({})", package.name, package.version, package.licence));
        }
    }
    if !refused.is_empty() {
        bail!("no allowed licence: {}", refused.join(", "));
    }
    let mut text = String::from(
        "# Third-party notices\n\nTreeline is built from these packages, each under the licence that its authors state. Where a \
         licence offers a choice, Treeline takes MIT or Apache-2.0. The full texts are in each package's \
         source, at the address given. Written by `cargo xtask licences` from the resolved dependency \
         graph of all platforms; packages that only build or test Treeline are in it too.\n",
    );
    for (licence, packages) in groups {
        text.push_str(&format!("\n## {licence}\n\n"));
        for Package { name, version, repository, .. } in packages {
            if repository.is_empty() {
                text.push_str(&format!("- {name} {version}\n"));
            } else {
                text.push_str(&format!("- [{name} {version}]({repository})\n"));
            }
        }
    }
    Ok(text)
}

/// Whether an SPDX expression can be met with allowed licences alone: of alternatives (OR) one must
/// be, of what applies together (AND) all. OR binds looser than AND; parentheses group.
fn is_allowed(expression: &str) -> bool {
    let spaced = expression.replace('(', " ( ").replace(')', " ) ");
    let tokens: Vec<&str> = spaced.split_whitespace().collect();
    let mut parser = Parser { tokens: &tokens };
    let allowed = parser.any();
    allowed == Some(true) && parser.tokens.is_empty()
}

/// Recursive descent over the tokens of an SPDX expression; `None` is a syntax error.
struct Parser<'a> {
    tokens: &'a [&'a str],
}

impl<'a> Parser<'a> {
    fn next(&mut self) -> Option<&'a str> {
        let (first, rest) = self.tokens.split_first()?;
        self.tokens = rest;
        Some(first)
    }

    fn take(&mut self, token: &str) -> bool {
        let found = self.tokens.first() == Some(&token);
        if found {
            self.tokens = &self.tokens[1..];
        }
        found
    }

    fn any(&mut self) -> Option<bool> {
        let mut allowed = self.all()?;
        while self.take("OR") {
            allowed |= self.all()?;
        }
        Some(allowed)
    }

    fn all(&mut self) -> Option<bool> {
        let mut allowed = self.one()?;
        while self.take("AND") {
            allowed &= self.one()?;
        }
        Some(allowed)
    }

    fn one(&mut self) -> Option<bool> {
        if self.take("(") {
            let allowed = self.any()?;
            return self.take(")").then_some(allowed);
        }
        let mut licence = self.next()?.to_owned();
        if self.take("WITH") {
            licence = format!("{licence} WITH {}", self.next()?);
        }
        Some(ALLOWED.contains(&licence.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::is_allowed;

    #[test]
    fn expressions() {
        for allowed in [
            "MIT",
            "MIT OR GPL-3.0-only",
            "(MIT OR Apache-2.0) AND Unicode-3.0",
            "Apache-2.0 WITH LLVM-exception OR GPL-2.0-only",
            "BSD-3-Clause AND (GPL-3.0-only OR Zlib)",
        ] {
            assert!(is_allowed(allowed), "{allowed}");
        }
        for refused in ["", "GPL-3.0-only", "MIT AND GPL-3.0-only", "MIT AND (", "MIT MIT", "(MIT", "WITH"] {
            assert!(!is_allowed(refused), "{refused}");
        }
    }
}
