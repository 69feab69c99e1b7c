//! The first and third of the invariants at the top of `src/lib.rs`, by reading the sources.

use std::fs;
use std::path::{Path, PathBuf};

fn source(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(path)
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The modules that `text` declares, in their order.
fn declared(text: &str) -> Vec<String> {
    let name =
        |line: &str| Some(line.trim().trim_start_matches("pub ").strip_prefix("mod ")?.strip_suffix(';')?.to_owned());
    text.lines().filter_map(name).collect()
}

/// The files of a module: `name.rs`, or all in `name/`.
fn files(name: &str) -> Vec<PathBuf> {
    let file = source(&format!("{name}.rs"));
    if file.exists() {
        return vec![file];
    }
    fs::read_dir(source(name)).unwrap().map(|entry| entry.unwrap().path()).collect()
}

/// The modules that come after each `crate::` outside comments and unit tests, braces included.
fn used(text: &str) -> Vec<String> {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let code: String = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let first = |rest: &str| {
        let words = rest.trim_start_matches('{').split(|c: char| !(c.is_alphanumeric() || c == '_'));
        words.take(1).map(str::to_owned).collect::<Vec<_>>()
    };
    code.split("crate::").skip(1).flat_map(first).collect()
}

#[test]
fn a_module_uses_only_modules_listed_before_it() {
    let modules = declared(&read(&source("lib.rs")));
    assert!(modules.len() > 10, "{modules:?}");
    for (place, module) in modules.iter().enumerate() {
        for file in files(module) {
            for other in used(&read(&file)) {
                let known = modules[..=place].contains(&other);
                assert!(known, "{} uses crate::{other}, which does not stand before {module}", file.display());
            }
        }
    }
}

#[test]
fn unsafe_code_stands_only_at_the_c_boundary() {
    for module in declared(&read(&source("lib.rs"))) {
        for file in files(&module) {
            let boundary = ["abi.rs", "host.rs"].iter().any(|name| file.ends_with(Path::new("fmi2").join(name)));
            let text = read(&file);
            assert!(boundary || !text.contains("unsafe"), "{}", file.display());
            for word in ["println!", "eprintln!", "std::thread", "std::time", "static mut", "process::exit"] {
                assert!(!text.contains(word) || module == "package", "{}: {word}", file.display());
            }
        }
    }
}
