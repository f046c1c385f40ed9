//! How the workspace hangs together. No inverse crime: the identification cannot import the simulator, nor the simulator the identification.
//!
//! What it is: the dependency graph as cargo resolves it, followed from both crates to everything that they reach, build and test
//! dependencies included.
//! What can go wrong: a path that is added anywhere in between shows here with its whole chain.
//! Reference: specification `house.md`, "`ident` and `hal-sim` never see each other".

use serde_json::Value;
use std::collections::BTreeMap;

/// The machine that the tests are built on. What other systems need is not there on a new machine: nothing has asked for it.
fn host() -> String {
    let said = std::process::Command::new("rustc").arg("-vV").output().expect("rustc runs").stdout;
    let said = String::from_utf8_lossy(&said).into_owned();
    said.lines().find_map(|line| line.strip_prefix("host: ")).expect("a host").to_owned()
}

fn metadata() -> Value {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let out = std::process::Command::new(cargo)
        .args(["metadata", "--format-version", "1", "--locked", "--filter-platform", &host(), "--manifest-path"])
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.toml"))
        .output()
        .expect("cargo runs");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

/// Everything that `from` reaches, with the crate through which it was first reached.
fn reached(graph: &Value, from: &str) -> BTreeMap<String, String> {
    let name = |id: &Value| -> String {
        let package = graph["packages"].as_array().expect("packages").iter().find(|p| p["id"] == *id).expect("a package");
        package["name"].as_str().expect("a name").to_owned()
    };
    let nodes = graph["resolve"]["nodes"].as_array().expect("nodes");
    let direct: BTreeMap<String, Vec<String>> =
        nodes.iter().map(|n| (name(&n["id"]), n["dependencies"].as_array().expect("ids").iter().map(name).collect())).collect();
    let mut seen = BTreeMap::new();
    let mut open = vec![from.to_owned()];
    while let Some(at) = open.pop() {
        for next in direct.get(&at).into_iter().flatten() {
            if !seen.contains_key(next) {
                seen.insert(next.clone(), at.clone());
                open.push(next.clone());
            }
        }
    }
    seen
}

fn chain(seen: &BTreeMap<String, String>, to: &str) -> String {
    let mut line = to.to_owned();
    let mut at = to;
    while let Some(before) = seen.get(at) {
        line = format!("{before} -> {line}");
        at = before;
    }
    line
}

#[test]
fn neither_side_reaches_the_other() {
    let graph = metadata();
    for (from, forbidden) in
        [("ident", ["hal-sim", "firmware-rig", "quadrig"]), ("hal-sim", ["ident", "quadrig", "quadrig-tests"])]
    {
        let seen = reached(&graph, from);
        for other in forbidden {
            assert!(!seen.contains_key(other), "{}", chain(&seen, other));
        }
        println!("{from} reaches {} crates, none of {forbidden:?}", seen.len());
        assert!(seen.contains_key("serde"), "the graph was read");
    }
    // the test can see a path where there is one
    let seen = reached(&graph, "quadrig");
    assert!(seen.contains_key("ident") && seen.contains_key("hal-sim"));
    assert_eq!(chain(&reached(&graph, "hal-sim"), "esc-pwm").split(" -> ").next(), Some("hal-sim"));
}

/// What a crate needs where nothing is switched on, without what its tests need.
fn needs(package: &str) -> Vec<String> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let out = std::process::Command::new(cargo)
        .args(["tree", "--locked", "--edges", "normal,build", "--no-default-features", "--prefix", "none", "--format", "{lib}"])
        .args([
            "--target",
            &host(),
            "--package",
            package,
            "--manifest-path",
            concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.toml"),
        ])
        .output()
        .expect("cargo runs");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8_lossy(&out.stdout).lines().skip(1).map(str::to_owned).collect()
}

/// A stranger who takes the pulses does not get this project's wire with them.
#[test]
fn pulses_need_the_traits_of_a_pin_and_nothing_else() {
    assert_eq!(needs("esc-pwm"), ["embedded_hal"]);
    assert!(needs("frame").iter().any(|name| name == "postcard"), "the test sees what there is");
}

/// A file that no program lists would compile nowhere, and its tests would never run.
#[test]
fn every_file_of_the_integration_tests_is_a_module_of_one_program() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let listed = |program: &str| std::fs::read_to_string(folder.join(program)).expect("a program");
    let (suite, boards) = (listed("suite.rs"), listed("boards.rs"));
    let mut files = 0;
    for entry in std::fs::read_dir(&folder).expect("a folder") {
        let name = entry.expect("an entry").file_name().into_string().expect("a name");
        let Some(stem) = name.strip_suffix(".rs").filter(|stem| !["suite", "boards"].contains(stem)) else { continue };
        let in_its = if stem.starts_with("emulated_") { &boards } else { &suite };
        assert!(in_its.contains(&format!("\nmod {stem};\n")), "tests/tests/{name} is in no program");
        files += 1;
    }
    let modules = [suite, boards].iter().flat_map(|text| text.lines()).filter(|line| line.starts_with("mod ")).count();
    assert!(files > 60 && files == modules, "{files} files, {modules} modules");
}
