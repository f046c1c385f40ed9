//! A folder of runs in one call: a row a run, one bad file one line, the same bytes however the work is shared.
//!
//! What it is: the built program on a small folder: alone, in shares by the command line and by Slurm's variables, and a second time.
//! What can go wrong: a bad file that stops the others, a share that misses a run, a second run that does the work again.
//! Units: as the tables' headers state.
//! Reference: README, `batch`.

use quadrig_tests::bench::{Bench, good_log};
use quadrig_tests::{Said, quadrig};
use std::fs;
use std::process::{Command, Stdio};

/// A bench with a folder `runs` of five good logs, one of them an export below a further folder, and a broken one.
fn bench() -> Bench {
    let bench = Bench::new();
    fs::create_dir_all(bench.path("runs/day 2")).unwrap();
    for k in 0..4 {
        let scaled: String = good_log()
            .lines()
            .map(|line| match line.split(',').collect::<Vec<_>>()[..] {
                [t, pulse, rpm, thrust, current, voltage] if t != "t_s" => {
                    let thrust = thrust.parse::<f64>().unwrap() * (1.0 + 0.1 * f64::from(k));
                    format!("{t},{pulse},{rpm},{thrust:.4},{current},{voltage}\n")
                }
                _ => format!("{line}\n"),
            })
            .collect();
        fs::write(bench.path(&format!("runs/run-{k}.csv")), scaled).unwrap();
    }
    let export: String = good_log().lines().skip(2).map(|l| l.replace("thrust_n", "Thrust (N)") + "\n").collect();
    fs::write(bench.path("runs/day 2/export, first.csv"), export).unwrap();
    fs::write(bench.path("runs/broken.csv"), "# quadrig-log 1\nt_s,rpm,thrust_n\n0,1,x\n").unwrap();
    fs::write(bench.path("runs/notes.md"), "no run\n").unwrap();
    bench
}

fn call(bench: &Bench, words: &[&str], variables: &[(&str, &str)]) -> Said {
    let mut command = Command::new(quadrig());
    command.args(words).current_dir(bench.folder()).stdin(Stdio::null()).envs(variables.iter().copied());
    Said::new(words, command.output().unwrap())
}

fn tables(bench: &Bench, folder: &str) -> [String; 2] {
    ["manifest.csv", "effects.csv"].map(|name| fs::read_to_string(bench.path(&format!("{folder}/{name}"))).unwrap())
}

#[test]
fn a_batch_is_a_row_a_run_however_it_is_shared() {
    let bench = bench();
    let said = call(&bench, &["batch", "runs", "-o", "one", "--jobs", "2", "--motor", "M"], &[]).succeeded();
    assert_eq!(
        said.err,
        "broken.csv: refused: broken.csv:3: column thrust_n: 'x'; expected a decimal number, or an empty field for a missing sample\n"
    );
    assert!(
        said.out.contains("6 of 6 runs: 5 closed, 1 refused (why: column message of one/manifest.csv)")
            && said.out.contains("0 were there already"),
        "{}",
        said.out
    );
    let [manifest, effects] = tables(&bench, "one");
    let rows: Vec<&str> = manifest.lines().collect();
    assert_eq!(rows.len(), 7);
    assert!(
        rows[0].starts_with("file,state,message,sha256,rows,seconds,motor,propeller,verdict,named,unexplained,k_t_n_s2,"),
        "{}",
        rows[0]
    );
    assert!(
        rows[1].starts_with("broken.csv,refused,") && rows[2].starts_with("\"day 2/export, first.csv\",closed,,"),
        "{manifest}"
    );
    assert!(rows[3].contains(",420,41.9,M,,"), "{}", rows[3]);
    assert!(effects.starts_with("file,effect,scope,"));
    // the constants are the runs' own: the second run has a tenth more thrust
    let at = rows[0].split(',').position(|n| n == "k_t_n_s2").unwrap();
    let k = |row: usize| rows[row].split(',').nth(at).unwrap().parse::<f64>().unwrap();
    assert!((k(4) / k(3) - 1.1).abs() < 0.01, "{} {}", k(3), k(4));

    // shares by the command line, and by a Slurm array that counts from 1
    for (i, variables) in [("1/2", vec![]), ("2/2", vec![])] {
        call(&bench, &["batch", "runs", "-o", "two", "--shard", i, "--motor", "M"], &variables).succeeded();
    }
    for id in ["1", "2", "3"] {
        let variables = [
            ("SLURM_ARRAY_TASK_ID", id),
            ("SLURM_ARRAY_TASK_MIN", "1"),
            ("SLURM_ARRAY_TASK_MAX", "3"),
            ("SLURM_ARRAY_TASK_COUNT", "3"),
        ];
        let said = call(&bench, &["batch", "runs", "-o", "three", "--motor", "M"], &variables).succeeded();
        assert!(said.out.starts_with(&format!("share {id}/3: 2 of 6 runs")), "{}", said.out);
        assert_eq!(bench.path("three/manifest.csv").exists(), id == "3", "{}", said.out);
    }
    for folder in ["two", "three"] {
        assert_eq!(tables(&bench, folder), [manifest.clone(), effects.clone()], "{folder}");
    }

    // what is there is not done again, what changed is
    let said = call(&bench, &["batch", "runs", "-o", "one", "--motor", "M"], &[]).succeeded();
    assert!(
        said.out.contains("5 closed, 1 refused") && said.out.contains("6 were there already") && said.err.is_empty(),
        "{}",
        said.out
    );
    fs::write(bench.path("runs/broken.csv"), good_log()).unwrap();
    fs::remove_file(bench.path("one/runs/run-2.csv.json")).unwrap();
    let said = call(&bench, &["batch", "runs", "-o", "one", "--motor", "M", "--folders"], &[]).succeeded();
    assert!(
        said.out.contains("6 closed; ") && said.out.contains("0 were there already"),
        "other options, other results: {}",
        said.out
    );
    assert!(bench.path("one/runs/day 2/export, first.csv/report.html").exists());
    let said = call(&bench, &["batch", "runs", "-o", "one", "--motor", "M", "--folders"], &[]).succeeded();
    assert!(said.out.contains("6 runs: 6 closed;") && said.out.contains("6 were there already"), "{}", said.out);
    assert!(tables(&bench, "one")[0].lines().nth(1).unwrap().starts_with("broken.csv,closed,"));

    // a batch that was cut off before its tables and their list goes on; a table that was changed since is left alone
    fs::remove_file(bench.path("one/.quadrig.sha256")).unwrap();
    fs::remove_file(bench.path("one/effects.csv")).unwrap();
    let again = ["batch", "runs", "-o", "one", "--motor", "M", "--folders"];
    let said = call(&bench, &again, &[]).succeeded();
    assert!(said.out.contains("6 were there already") && bench.path("one/effects.csv").exists(), "{}", said.out);
    let mine = tables(&bench, "one")[0].clone() + "by hand\n";
    fs::write(bench.path("one/manifest.csv"), &mine).unwrap();
    call(&bench, &again, &[]).refused(&["one: manifest.csv was changed since `quadrig batch` wrote it", "expected a new"]);
    assert_eq!(tables(&bench, "one")[0], mine);
}

#[test]
fn a_batch_refuses_what_is_none() {
    let bench = bench();
    call(&bench, &["batch", "nowhere", "-o", "out"], &[]).refused(&["nowhere"]);
    fs::create_dir(bench.path("worse")).unwrap();
    fs::copy(bench.path("runs/broken.csv"), bench.path("worse/broken.csv")).unwrap();
    let none = call(&bench, &["batch", "worse", "-o", "none"], &[]);
    assert_eq!(none.status, Some(1), "{}", none.err);
    assert!(none.err.ends_with("quadrig: worse: not one of its runs closes (1 in all); expected one run at least that `quadrig close-loop` takes (why not: column message of none/manifest.csv)\n"), "{}", none.err);
    assert!(bench.path("none/manifest.csv").exists(), "its row says why");
    fs::create_dir(bench.path("empty")).unwrap();
    call(&bench, &["batch", "empty", "-o", "out"], &[]).refused(&["empty: no file ends in .csv"]);
    let odd = [("SLURM_ARRAY_TASK_ID", "x")];
    call(&bench, &["batch", "runs", "-o", "out"], &odd).refused(&["SLURM_ARRAY_TASK_ID=x: expected a number"]);
    assert_eq!(call(&bench, &["batch", "runs", "-o", "out", "--shard", "3/2"], &[]).status, Some(2));
    assert!(!bench.path("out").exists());
}
