//! Schedule files that are wrong: one line with file, line and column.

use schedule::Plan;
use std::path::Path;

fn refused(text: &str) -> String {
    let said = Plan::parse(text, Path::new("plan.toml")).expect_err("it is wrong").to_string();
    assert!(!said.contains('\n'), "{said}");
    said
}

#[test]
fn what_is_wrong_is_named_with_its_place() {
    for (text, start, word) in [
        ("", "plan.toml:1:1: ", "expected part"),
        ("nmae = \"x\"\n[[part]]\nkind = \"hold\"\n", "plan.toml:1:1: ", "expected one of name, part"),
        ("part = []\n", "plan.toml:1:8: ", "not empty"),
        ("[[part]]\npulse_us = 1500\n", "plan.toml:1:1: ", "expected kind"),
        ("[[part]]\nkind = \"hodl\"\n", "plan.toml:2:8: ", "hold, staircase"),
        ("[[part]]\nkind = \"hold\"\npulse_us = 1500\n", "plan.toml:2:8: ", "a hold: expected hold_s"),
        ("[[part]]\nkind = \"hold\"\npulse_us = 2500\nhold_s = 1\n", "plan.toml:3:12: ", "from 1000 to 2000, found 2500"),
        ("[[part]]\nkind = \"hold\"\npulse_us = \"full\"\nhold_s = 1\n", "plan.toml:3:12: ", "found a text"),
        ("[[part]]\nkind = \"hold\"\npulse_us = 1500\nhold_s = nan\n", "plan.toml:4:10: ", "a number"),
        ("[[part]]\nkind = \"hold\"\npulse_us = 1500\nhold_s = 1\nramp = true\n", "plan.toml:5:1: ", "hold_s, kind, pulse_us"),
        ("[[part]]\nkind = \"staircase\"\nstep_us = 50\ntop_us = 1020\nhold_s = 1\n", "plan.toml:4:10: ", "at least one step"),
        ("[[part]]\nkind = \"staircase\"\nstep_us = 50\nhold_s = 1\nvisits = 1.5\n", "plan.toml:5:10: ", "whole number"),
        ("[[part]]\nkind = \"staircase\"\nstep_us = 50\nhold_s = 1\ndown = 1\n", "plan.toml:5:8: ", "true or false"),
        ("[[part]]\nkind = \"steps\"\nsteps = [{ pulse_us = 1500 }]\n", "plan.toml:3:10: ", "expected hold_s"),
        ("[[part]]\nkind = \"steps\"\nsteps = [7]\n", "plan.toml:3:10: ", "expected a step"),
        ("[[part]]\nkind = \"chirp\"\ncentre_us = 1900\namplitude_us = 200\n", "plan.toml:4:16: ", "from 0 to 100"),
        ("[[part]]\nkind = \"visits\"\nhold_s = 1\nlevels_us = [1500, 999]\n", "plan.toml:4:20: ", "found 999"),
        (
            "[[part]]\nkind = \"visits\"\nhold_s = 1\nlevels_us = [1500]\nbetween_s = 1\n",
            "plan.toml:5:13: ",
            "expected between_us",
        ),
        ("[[part]]\nkind = \"settle\"\npulse_us = 1500\nat_most_s = 9\nchannel = \"rps\"\n", "plan.toml:5:11: ", "thrust_n"),
        ("[[part]]\nkind = \"settle\"\npulse_us = 1500\nat_most_s = 2\n", "plan.toml:4:13: ", "more than over_s"),
        ("[[part]]\nkind = \"settle\"\npulse_us = 1500\nat_most_s = 9\notherwise = \"wait\"\n", "plan.toml:5:13: ", "go-on"),
        (
            "[[part]]\nkind = \"thrust\"\nthrust_n = 2\nstart_us = 1900\nhigh_us = 1800\nlength_s = 1\n",
            "plan.toml:4:12: ",
            "1000 to 1800",
        ),
        ("[[part]]\nkind = \"replay\"\nfile = \"nowhere.csv\"\n", "nowhere.csv: cannot be read", ""),
        ("[[part]]\nkind = \"replay\"\nfile = \"a.csv\"\nfrom_s = 3\nuntil_s = 2\n", "plan.toml:5:11: ", "after 3"),
        ("[[part]\n", "plan.toml:1:", ""),
    ] {
        let said = refused(text);
        assert!(said.starts_with(start) && said.contains(word), "{text:?}: {said}");
    }
}

#[test]
fn a_log_that_cannot_be_replayed_is_named_with_its_place() {
    let folder = tempfile::TempDir::new().unwrap();
    let plan = folder.path().join("plan.toml");
    std::fs::write(&plan, "[[part]]\nkind = \"replay\"\nfile = \"log.csv\"\n").unwrap();
    for (log, start, word) in [
        ("", "log.csv:1:1: ", "column names"),
        ("t_s,pulse_us_1\n0,1500\n", "log.csv:1:1: ", "its pulses are pulse_us_1"),
        ("# x\nt_s,pulse_us\n0,1500\n0,1500\n", "log.csv:4:1: ", "after 0"),
        ("t_s,rpm,pulse_us\n0,12,1500\n1,12,2100\n", "log.csv:3:6: ", "found 2100"),
        ("t_s,pulse_us\n0,fast\n", "log.csv:2:3: ", "found \"fast\""),
        ("t_s,pulse_us\n0,\n", "log.csv:1:1: ", "no pulse"),
    ] {
        std::fs::write(folder.path().join("log.csv"), log).unwrap();
        let said = Plan::read(&plan).expect_err("it is wrong").to_string();
        let said = said.strip_prefix(&format!("{}/", folder.path().display())).unwrap_or(&said).to_owned();
        assert!(said.starts_with(start) && said.contains(word), "{log:?}: {said}");
    }
}

#[test]
fn a_verdict_without_an_experiment_is_refused() {
    let folder = tempfile::TempDir::new().unwrap();
    let file = folder.path().join("verdict.json");
    for (text, word) in [
        ("{\"format\": \"quadrig-verdict 2\"}", "proposes no next experiment"),
        ("{\"next_experiment\": {\"why\": \"x\", \"schedule\": [\n{\"pulse_us\": 2500, \"hold_s\": 3}]}}", ":2:17: "),
        ("{\"next_experiment\": {\"why\": \"turn it\", \"motion\": []}}", "missing field `schedule`"),
        (
            "{\"next_experiment\": {\"why\": \"no run separates them\", \"separates\": false, \"schedule\": [{\"pulse_us\": 1500, \"hold_s\": 3}]}}",
            "proposes no next experiment: no run separates them",
        ),
        ("no json", ":1:"),
    ] {
        std::fs::write(&file, text).unwrap();
        let said = Plan::read(&file).expect_err("it is wrong").to_string();
        assert!(said.contains(word) && !said.contains('\n'), "{text}: {said}");
    }
}

#[test]
fn the_thesis_staircase_is_one_part() {
    let plan = Plan::parse("[[part]]\nkind = \"staircase\"\nstep_us = 50\nhold_s = 30\n", Path::new("thesis.toml")).unwrap();
    assert_eq!((plan.segments().len(), plan.longest_s(), plan.highest().as_us()), (21, 630.0, 2000.0));
    assert_eq!(plan.summary(), "thesis: 1 parts, 10.5 min, up to 2000 us");
}

/// Every example, and the page's own, is a schedule.
#[test]
fn the_examples_are_schedules() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    let mut seen = 0;
    for entry in std::fs::read_dir(root.join("examples/schedule")).unwrap() {
        let plan = Plan::read(&entry.unwrap().path()).unwrap_or_else(|e| panic!("{e}"));
        println!("{}", plan.summary());
        seen += 1;
    }
    assert!(seen >= 4);
    let page = std::fs::read_to_string(root.join("docs/schedule.md")).unwrap();
    let text = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    assert_eq!(Plan::parse(text, Path::new("page.toml")).unwrap().places().len(), 2);
}
