//! The house's plan, held against the source: data flows one way, the core is `no_std` integers but for the
//! camera model, and `unsafe` stays where registers are.

use proc_macro2::{TokenStream, TokenTree};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// A file's code: no comments, no tests at its end, no strings.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let lines = text.lines().take_while(|l| l.trim() != "#[cfg(test)]" || text.ends_with("mod tests;\n"));
    let mut code = String::new();
    for line in lines {
        let line = line.split("//").next().unwrap_or_default();
        code.extend(line.split('"').step_by(2).flat_map(|part| [part, " "]));
        code.push('\n');
    }
    code
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

fn words(code: &str) -> impl Iterator<Item = &str> {
    code.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|w| !w.is_empty())
}

/// Names of the stages in the order of `pub mod` lines.
fn stages(module: &Path) -> Vec<String> {
    let text = fs::read_to_string(module).unwrap();
    let name = |l: &str| Some(l.strip_prefix("pub mod ")?.strip_suffix(';')?.to_owned());
    text.lines().filter_map(name).collect()
}

/// What `use crate::stage::..` lines and paths name: (stage, items).
fn stage_uses(code: &str) -> Vec<(String, String)> {
    let uses = code.split("stage::").skip(1);
    uses.map(|rest| {
        let stage: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        let items = rest[stage.len()..].split([';', '(', '\n']).next().unwrap_or_default().to_owned();
        (stage, items)
    })
    .collect()
}

#[test]
fn no_stage_uses_a_later_one() {
    let folder = root().join("shared/src/stage");
    let order = stages(&folder.join("mod.rs"));
    assert!(order.len() >= 18, "{order:?}");
    for (place, name) in order.iter().enumerate() {
        let code = code(&folder.join(format!("{name}.rs")));
        for (used, _) in stage_uses(&code) {
            let at = order.iter().position(|s| *s == used);
            assert!(at.is_some_and(|at| at < place), "{name} uses {used}, which comes later");
        }
        assert!(!code.contains("pipeline"), "{name} knows the pipeline");
    }
}

/// A stage takes types and constants of earlier stages. It calls functions of at most one other stage,
/// its own tool: hulls are compared by their invariants, pruning edits the graph. Whoever calls two
/// chains them, and only the pipeline does.
#[test]
fn only_the_pipeline_chains_stages() {
    let folder = root().join("shared/src/stage");
    for name in stages(&folder.join("mod.rs")) {
        let calls: Vec<String> = stage_uses(&code(&folder.join(format!("{name}.rs"))))
            .into_iter()
            .filter(|(_, items)| words(items).any(|item| item.starts_with(|c: char| c.is_lowercase())))
            .map(|(stage, _)| stage)
            .collect();
        assert!(calls.len() <= 1, "{name} calls functions of {calls:?}");
    }
    let chained: std::collections::BTreeSet<_> = rust_files(&root().join("shared/src/pipeline"))
        .iter()
        .flat_map(|file| stage_uses(&code(file)))
        .map(|(stage, _)| stage)
        .collect();
    // Hulls call their invariants, and whoever has raw pictures resamples them before the chain begins.
    for name in
        stages(&folder.join("mod.rs")).iter().filter(|n| !["invariants", "warp"].contains(&n.as_str()))
    {
        assert!(chained.contains(name), "nobody runs {name}");
    }
}

#[test]
fn the_core_has_no_std_no_alloc_and_floats_only_in_the_camera_model() {
    let library = fs::read_to_string(root().join("shared/src/lib.rs")).unwrap();
    assert!(library.contains("#![no_std]") && library.contains("#![forbid(unsafe_code)]"));
    for file in rust_files(&root().join("shared/src")) {
        let model = ["camera.rs", "wire/calibration.rs"]
            .iter()
            .any(|name| file.ends_with(format!("shared/src/{name}")));
        for word in words(&code(&file)) {
            let banned = ["std", "alloc", "unsafe"].contains(&word);
            assert!(!banned, "{} says {word}", file.display());
            // One format, one order of operations, and no functions but those of software.
            let float = word.contains("f32") || word.contains("f64") || ["nalgebra", "libm"].contains(&word);
            let fused = word.contains("f32") || word.contains("mul_add") || word == "fma";
            assert!(if model { !fused } else { !float }, "{} says {word}", file.display());
        }
    }
}

/// Every `unsafe` of these tokens, by the function that it stands in, or that it makes unsafe. What a macro
/// is made of counts like any code.
fn count_unsafe(tokens: TokenStream, mut function: String, found: &mut BTreeMap<String, usize>) {
    let mut tokens = tokens.into_iter().peekable();
    let name = |token: Option<&TokenTree>| token.map(ToString::to_string).unwrap_or_default();
    while let Some(token) = tokens.next() {
        match &token {
            TokenTree::Ident(word) if word == "fn" => {
                // The name of a function that a macro makes is a variable.
                tokens.next_if(|token| token.to_string() == "$");
                function = name(tokens.peek());
            }
            TokenTree::Ident(word) if word == "unsafe" => {
                let next = name(tokens.peek());
                if next == "fn" {
                    tokens.next();
                    function = name(tokens.peek());
                }
                *found.entry(function.clone()).or_default() += 1;
            }
            TokenTree::Group(group) => count_unsafe(group.stream(), function.clone(), found),
            _ => {}
        }
    }
}

/// Clippy asks for the reason beside each of them; the list is what a change of it is seen by.
#[test]
fn unsafe_stays_with_registers_and_on_its_list() {
    let mut list = "# Every `unsafe` of the project: file, function, how many.\n".to_owned();
    for package in ["shared", "host", "firmware", "tests", "fuzz"] {
        for file in rust_files(&root().join(package)) {
            let tokens = fs::read_to_string(&file).unwrap().parse().unwrap();
            let mut found = BTreeMap::new();
            count_unsafe(tokens, String::new(), &mut found);
            let name = file.strip_prefix(root()).unwrap().display().to_string();
            let allowed = name == "host/src/wide.rs"
                || ["firmware/src/board/", "host/src/wide/"].iter().any(|place| name.starts_with(place));
            assert!(allowed || found.is_empty(), "{name} is unsafe");
            list.extend(found.iter().map(|(function, count)| format!("{name} {function} {count}\n")));
        }
    }
    let frozen = root().join("tests/frozen/unsafe.txt");
    if std::env::var_os("REGENERATE").is_some() {
        fs::write(&frozen, &list).unwrap();
    }
    let known = fs::read_to_string(&frozen).unwrap_or_default();
    assert_eq!(list, known, "changed on purpose? REGENERATE=1 freezes what is found");
    let manifest = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    assert!(manifest.contains("unsafe_code = \"deny\""));
}

/// Every fault's row names tests, and each stands where the row says.
#[test]
fn faults_name_tests_that_exist() {
    let document = fs::read_to_string(root().join("docs/reliability.md")).unwrap();
    let faults = document.split("\n## ").find(|section| section.starts_with("Faults\n")).unwrap();
    for row in faults.lines().filter(|line| line.starts_with("| ")).skip(1) {
        let (mut files, mut named) = (Vec::new(), 0);
        for (at, part) in row.split('`').enumerate() {
            let place = root().join(if part.contains('/') { "" } else { "tests/tests" }).join(part);
            let file = place.with_extension("rs");
            if at % 2 == 1 && file.is_file() {
                files = vec![file];
            } else if at % 2 == 1 && place.join("main.rs").is_file() {
                files = rust_files(&place);
            }
            for test in words(part).filter(|word| at % 2 == 0 && word.matches('_').count() > 1) {
                let is_there = |file| fs::read_to_string(file).unwrap().contains(&format!("fn {test}("));
                assert!(files.iter().any(is_there), "{files:?} have no {test}");
                named += 1;
            }
        }
        assert!(named > 0, "no test is named: {row}");
    }
}
