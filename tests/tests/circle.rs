//! The circle: the corrected model as the plant, the same schedule again, and nothing is left.
//!
//! What it is: `quadrig loop` on scenarios with one hidden effect each, on the drive, the supply and the load cell; and with
//! `--auto` on one whose first run cannot tell what it was.
//! What can go wrong: the simulator refuses the model, the second run holds something that the model does not say, or the tool's
//! own next experiments do not settle a question.
//! Units: as the channels state.
//! Reference: specification `closing-the-loop.md`, step 9.

use quadrig_tests::call;
use serde_json::Value;
use tempfile::TempDir;

/// Smallest whiteness of a channel of the second run. Eight channels a run, five runs: by chance alone one p-value in forty
/// falls below 0.025; one below a thousandth does not.
const WHITE: f64 = 1.0e-3;

/// A run of 250 s up and down with one effect, with seeds on which the rules of what is judged were settled: a regression test, no proof.
fn scenario(seed: u32, effect: &str) -> String {
    format!("seed = {seed}\nschedule = {{ kind = \"up_down\", step_us = 50, hold_s = 6, top_us = 2000 }}\n[[effect]]\n{effect}\n")
}

fn account(text: &str, words: &[&str]) -> Value {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("rig.toml"), text).unwrap();
    let out = call(folder.path(), &[&["loop", "rig.toml", "--json", "-o", "out"], words].concat()).succeeded().out;
    let account: Value = serde_json::from_str(&out).expect("the account is JSON");
    let file = std::fs::read_to_string(folder.path().join("out/loop.json")).expect("loop.json");
    assert_eq!(serde_json::from_str::<Value>(&file).expect("JSON"), account);
    let model = std::fs::read_to_string(folder.path().join("out/model.toml")).expect("a model");
    assert!(model.contains("[[effect]]"), "{model}");
    account
}

#[test]
fn the_same_schedule_on_the_corrected_model_leaves_noise() {
    let mut faults = Vec::new();
    for (seed, effect) in [
        (3101, "id = \"zero_drift\"\nrate_n_per_s = 6e-4"),
        (3102, "id = \"supply_sag\"\nresistance_ohm = 0.08"),
        (3103, "id = \"channel_filter\"\ntau_s = 0.6"),
        (3104, "id = \"creep\"\namplitude = 0.04\ntau_s = 25.0"),
        (3105, "id = \"battery_discharge\"\ncapacity_ah = 0.5"),
    ] {
        let account = account(&scenario(seed, effect), &[]);
        let id = account["hidden"][0].as_str().expect("one hidden effect");
        if !account["effects"].as_array().expect("effects").iter().any(|e| e == id) {
            faults.push(format!("{id}: not named, but {}", account["effects"]));
        }
        if account["circle"]["closes"] != true {
            faults.push(format!("{id}: the search still finds {}", account["circle"]["left"]));
        }
        for (channel, figures) in account["circle"]["channels"].as_object().expect("channels") {
            let figure = |name: &str| figures[name].as_f64().expect("a figure");
            println!(
                "{id} {channel}: rms {:.5}, floor {:.5}, p {:.4}",
                figure("rms"),
                figure("noise_floor_rms"),
                figure("whiteness_p")
            );
            assert!(figure("samples") > 500.0, "{id}: {channel} was judged on {} samples", figure("samples"));
            if figure("whiteness_p") < WHITE {
                faults.push(format!("{id}: {channel} leaves a coloured residual, {figures}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The judgement can fail: a plant that does something the model does not say is found out.
#[test]
fn a_wrong_model_does_not_close_the_circle() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(
        path("healthy.toml"),
        "seed = 3106\nschedule = { kind = \"up_down\", step_us = 50, hold_s = 6, top_us = 2000 }\n",
    )
    .unwrap();
    std::fs::write(path("creeping.toml"), scenario(3107, "id = \"creep\"\namplitude = 0.04\ntau_s = 25.0")).unwrap();
    for rig in ["healthy", "creeping"] {
        let (scenario, log, out) = (format!("{rig}.toml"), format!("{rig}.csv"), format!("{rig}-out"));
        call(folder.path(), &["--quiet", "sim", &scenario, "-o", &log]).succeeded();
        call(folder.path(), &["--quiet", "close-loop", &log, "-o", &out]).succeeded();
    }
    call(folder.path(), &["--quiet", "sim", "creeping.toml", "--model", "creeping-out/model.toml", "-o", "again.csv"])
        .succeeded();
    let read = |name: &str| ident::model::Model::read(&path(name)).unwrap();
    let again = ident::log::Log::read(&path("again.csv")).unwrap();
    let right = ident::close::circle::circle(&again, &read("creeping-out/model.toml"));
    let wrong = ident::close::circle::circle(&again, &read("healthy-out/model.toml"));
    let thrust =
        |c: &ident::close::circle::Circle| c.channels.iter().find(|l| l.channel == "thrust_n").expect("thrust").whiteness_p;
    assert!(right.closes() && thrust(&right) > WHITE, "{:?}", right.channels);
    assert!(!wrong.closes() && thrust(&wrong) < 1.0e-6, "{:?}", wrong.channels);
}

/// What no residual shows and the board tells is named by the loop too, beside what this rig's dynamics leave over.
#[test]
fn the_loop_names_what_the_board_tells_of_its_marks() {
    let account = account(&scenario(3108, "id = \"alternating_period\"\nangle_deg = 20.0"), &["--no-circle"]);
    assert_eq!(account["verdict"], "attributed", "{account:#}");
    assert_eq!(account["effects"].as_array().expect("effects").last(), Some(&Value::from("alternating_period")), "{account:#}");
}

/// On a short upward staircase a shift of the tare looks like other things. The tool's own next runs settle it.
#[test]
fn the_tools_own_next_experiments_settle_a_question() {
    let text = "seed = 5\nschedule = { kind = \"staircase\", step_us = 100, hold_s = 6, top_us = 2000 }\n\
                [[effect]]\nid = \"tare_shift\"\noffset_n = 0.05\nt0_s = 30.0\n";
    let account = account(text, &["--auto"]);
    let rounds = account["rounds"].as_array().expect("rounds");
    println!("{} rounds, {}", rounds.len(), account["effects"]);
    assert_eq!(account["extra_runs"].as_u64().expect("a number") as usize, rounds.len() - 1);
    for (k, round) in rounds.iter().enumerate() {
        assert_eq!(round["open"] == true, k + 1 < rounds.len(), "only an open question asks for another run: {round}");
    }
    assert_eq!(account["verdict"], "attributed", "{account:#}");
    assert!(account["effects"].as_array().expect("effects").iter().any(|e| e == "tare_shift"), "{account:#}");
}
