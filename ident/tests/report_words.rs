//! Sentence and terminal text say what the verdict says, and no more.
//!
//! What it is: a verdict of each kind, made by hand, with the words that must and must not stand at its head.
//! What can go wrong: a wording that claims more than the verdict.
//! Units: as stated.
//! Reference: specification `formats.md`, "Verdict".

use ident::report::{Hidden, Vocabulary, WIDEST, sentence, terminal};
use ident::signal::bad::SetAside;
use ident::verdict::Scope;
use ident::verdict::{
    Alternative, BeforeAfter, Change, Channel, Channels, EffectEntry, FORMAT, Figures, Kin, Kind, NextExperiment, Parameter,
    ScheduleStep, Unexplained, Validation, Verdict,
};

fn parameter(name: &str, value: f64, half: f64, unit: &str) -> Parameter {
    Parameter { name: name.into(), value, unit: unit.into(), ci95: [value - half, value + half] }
}

fn effect(id: &str, on: &str, p: f64, removes: f64, parameters: Vec<Parameter>) -> EffectEntry {
    EffectEntry {
        kin: if ["spinup_lag", "rotor_inertia"].contains(&id) { Kin::OfEvery } else { Kin::Own },
        id: id.into(),
        scope: Scope::Rig,
        run: None,
        channels: vec![on.into()],
        depends_on: vec!["t_s".into()],
        equation: "reading = truth".into(),
        probability: p,
        parameters,
        heldout_error_reduction: removes,
        evidence: "a long account of what the residual looks like, which the terminal must break into several lines of its own"
            .into(),
    }
}

fn filter(p: f64) -> EffectEntry {
    effect("channel_filter", "thrust_n", p, 0.9, vec![parameter("window", 0.5, 0.02, "s")])
}

fn sag(p: f64) -> EffectEntry {
    effect("supply_sag", "voltage_v", p, 0.85, vec![parameter("resistance", 0.041, 0.0012, "ohm")])
}

fn verdict(kind: Kind, effects: Vec<EffectEntry>) -> Verdict {
    let of = |rms: f64| Figures { rms, heldout_rms: rms, across_runs_rms: None, whiteness_p: 0.2 };
    let channel = |unit: &str, floor: f64, before: f64, after: f64| Channel {
        unit: unit.into(),
        noise_floor_rms: floor,
        before: of(before),
        after: of(after),
    };
    let mut channels = Channels::default();
    channels.predicted.insert("thrust_n".into(), channel("N", 0.01, 0.3, 0.0304));
    channels.predicted.insert("voltage_v".into(), channel("V", 0.01, 0.5, 0.08));
    Verdict {
        format: FORMAT,
        run: "run.csv".into(),
        verdict: kind,
        channels,
        effects,
        unexplained: vec![],
        alternatives: vec![],
        next_experiment: None,
        left_out: vec![],
        set_aside: vec![],
        guessed_floors: None,
        sensor_share: None,
        at_rest: false,
        held: false,
        validation: vec![],
        runs: vec![],
    }
}

fn left(channel: &str, over_floor: f64) -> Unexplained {
    Unexplained { channel: channel.into(), over_floor, depends_on: vec!["temp_c".into()], looks_like: "slow".into() }
}

fn alternative(ids: &[&str], probability: f64) -> Alternative {
    Alternative { ids: ids.iter().map(|i| (*i).to_owned()).collect(), probability, change: None }
}

/// Verdict, whether a model was declared, words at the head, words that must not stand there.
fn cases() -> Vec<(Verdict, bool, &'static [&'static str], &'static [&'static str])> {
    let both = || vec![filter(0.99), sag(0.99)];
    let with_left = |v: Verdict| Verdict { unexplained: vec![left("thrust_n", 3.1)], ..v };
    let open = |p: f64| Verdict {
        alternatives: vec![
            alternative(&["channel_delay", "supply_sag"], p),
            alternative(&["channel_filter", "battery_discharge"], 0.01),
        ],
        ..verdict(Kind::Ambiguous, vec![filter(0.5), sag(0.99)])
    };
    let small_filter = EffectEntry { heldout_error_reduction: 0.2, ..filter(0.5) };
    let schedule = vec![ScheduleStep { pulse_us: 1500.0, hold_s: 30.0 }];
    let next = NextExperiment { why: "they differ most on long holds".into(), separates: true, schedule };
    let alike = NextExperiment { why: "no run at hand separates them".into(), separates: false, ..next.clone() };
    vec![
        (
            verdict(Kind::Attributed, both()),
            false,
            &[
                "The load cell reads the mean of its last 0.50 s, and the supply lead drops 41 mV per ampere. Together they explain",
                "thrust and voltage had left over",
                "Little is left beyond the noise.",
            ],
            &["probably", "perhaps", "New since"],
        ),
        (
            with_left(verdict(Kind::Attributed, vec![filter(0.7)])),
            true,
            &[
                "New since the declared model, on top of what it has: the load cell probably reads the mean of its last 0.50 s. That explains 99 % of what thrust had left over. On thrust 0.0304 N rms is left (slow).",
            ],
            &["noise."],
        ),
        (
            verdict(Kind::Attributed, vec![filter(0.99), effect("unknown", "thrust_n", 0.999, 0.4, vec![])]),
            false,
            &["With all that is told below the model explains 99 % of what thrust had left over."],
            &["That explains", "named below"],
        ),
        (verdict(Kind::Attributed, vec![filter(0.55)]), false, &["The load cell perhaps reads"], &["probably"]),
        (
            verdict(Kind::Attributed, vec![sag(0.9), effect("creep", "thrust_n", 0.9, 0.001, vec![])]),
            false,
            &[
                "The supply lead drops 41 mV per ampere. That explains 97 % of what voltage had left over. A smaller cause is told below.",
            ],
            &["creeps", "thrust"],
        ),
        (
            verdict(
                Kind::Attributed,
                vec![effect("spinup_lag", "thrust_n", 0.99, 0.5, vec![parameter("tau_up", 0.037, 0.001, "s")])],
            ),
            false,
            &["Nothing of this rig's own was named. What every rig has: the rotor takes 37 ms to follow the command."],
            &[],
        ),
        (
            open(0.45),
            false,
            &[
                "Either the load cell reads the mean of its last 0.50 s, or the load cell answers late: this run cannot tell. Beside that, the supply lead drops 41 mV per ampere.",
            ],
            &["Together they explain", "battery", "proposed"],
        ),
        (
            // words and figures agree
            open(0.11),
            false,
            &[
                "Perhaps the load cell reads the mean of its last 0.50 s, or, less likely, the load cell answers late: this run cannot tell.",
            ],
            &["Either"],
        ),
        (
            // what takes most is told first, although it is no question
            Verdict { alternatives: open(0.45).alternatives, ..verdict(Kind::Ambiguous, vec![small_filter, sag(0.99)]) },
            false,
            &[
                "The supply lead drops 41 mV per ampere. Either the load cell reads the mean of its last 0.50 s, or the load cell answers late: this run cannot tell.",
            ],
            &["Beside"],
        ),
        (
            Verdict { next_experiment: Some(next), ..open(0.45) },
            false,
            &["this run cannot tell, the run proposed below may.", "The model as it is now explains 98 % of what"],
            &["Together they explain"],
        ),
        (
            Verdict { next_experiment: Some(alike), ..open(0.45) },
            false,
            &["this run cannot tell, nor can any schedule that was tried."],
            &["proposed"],
        ),
        (
            Verdict {
                unexplained: vec![left("thrust_n", 3.1)],
                ..verdict(Kind::Unattributed, vec![effect("unknown", "thrust_n", 0.9, 0.4, vec![])])
            },
            false,
            &[
                "Something is left on thrust that no known effect explains. It goes with time; a smooth term without a name was fitted. On thrust 0.0304 N rms is left (slow).",
            ],
            &["explains thrust", "%"],
        ),
        (
            verdict(Kind::Unattributed, vec![effect("unknown", "thrust_n", 0.9, 0.0, vec![])]),
            true,
            &["New since the declared model: something is left on thrust", "nothing was added to the model"],
            &["was fitted"],
        ),
        (
            verdict(Kind::None, vec![]),
            false,
            &["The declared model explains the run: no channel is left with more than its noise."],
            &["The load cell", "lacks"],
        ),
        (verdict(Kind::None, vec![]), true, &["The declared model still explains the run"], &[]),
        (
            with_left(verdict(Kind::None, vec![])),
            false,
            &["No name was found for what the declared model leaves over. On thrust 0.0304 N rms is left (slow)."],
            &["more than its noise", "explains"],
        ),
        (
            with_left(verdict(Kind::None, vec![])),
            true,
            &["Nothing has changed since the model was made; the same errors remain, most on thrust: 0.0304 N rms."],
            &["explains", "New since", "is left"],
        ),
        (
            Verdict { guessed_floors: Some(16), ..verdict(Kind::None, vec![]) },
            false,
            &["As far as guessed noise floors tell, the declared model explains the run"],
            &["The declared model explains"],
        ),
        (
            // a question does not hide what has no name
            Verdict {
                alternatives: open(0.45).alternatives,
                ..verdict(Kind::Ambiguous, vec![filter(0.5), sag(0.99), effect("unknown", "thrust_n", 0.9, 0.4, vec![])])
            },
            false,
            &["With all that is told below the model explains"],
            &[],
        ),
        (
            // what is still there in the main is not passed over
            with_left(verdict_with_thrust_after(0.28, vec![sag(0.99)])),
            false,
            &["On thrust 0.280 N rms is left (slow). No known effect explains it."],
            &[],
        ),
        (with_left(verdict(Kind::Attributed, vec![filter(0.99)])), false, &["is left (slow)."], &["No known effect"]),
        (without_model(&["rpm_1", "rpm_2"]), false, &["no command was logged."], &["channels have no model"]),
        (
            without_model(&["rpm_1", "rpm_2", "rpm_3"]),
            false,
            &["3 channels have no model: why is told below."],
            &["no command was logged"],
        ),
    ]
}

/// A verdict whose thrust is left with an error.
fn verdict_with_thrust_after(after: f64, effects: Vec<EffectEntry>) -> Verdict {
    let mut v = verdict(Kind::Attributed, effects);
    let thrust = v.channels.predicted.get_mut("thrust_n").expect("a channel");
    (thrust.after.rms, thrust.after.heldout_rms) = (after, after);
    v
}

/// A verdict beside which some channels have no model.
fn without_model(names: &[&str]) -> Verdict {
    let mut v = verdict(Kind::Attributed, vec![filter(0.99)]);
    v.channels.not_predicted = names.iter().map(|n| ((*n).to_owned(), "no command was logged".to_owned())).collect();
    v
}

#[test]
fn the_sentence_never_claims_more_than_the_verdict() {
    let mut faults = Vec::new();
    for (v, news, words, never) in cases() {
        let said = sentence(&v, Vocabulary::RIG, news);
        for word in words.iter().filter(|w| !said.contains(**w)) {
            faults.push(format!("'{said}' lacks '{word}'"));
        }
        for word in never.iter().filter(|w| said.contains(**w)) {
            faults.push(format!("'{said}' holds '{word}'"));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// A hypothesis that puts one name in the place of an effect.
fn in_place_of(place: usize, id: &str, on: &str, probability: f64) -> Alternative {
    let change = Change { place, id: id.into(), channels: vec![on.into()], probability };
    Alternative { ids: vec![id.into()], probability, change: Some(change) }
}

/// Four causes, two of them sure, and something left on every channel.
fn crowded() -> Verdict {
    let torque = || effect("channel_filter", "torque_nm", 0.34, 0.2, vec![parameter("tau", 0.072, 0.01, "s")]);
    let mut v = verdict(Kind::Attributed, vec![filter(0.99), sag(0.99), effect("creep", "thrust_n", 0.9, 0.2, vec![]), torque()]);
    v.unexplained = vec![left("thrust_n", 3.1), left("voltage_v", 8.0)];
    v
}

#[test]
fn the_head_is_short_and_names_the_largest_remainder() {
    for (kind, alternatives) in
        [(Kind::Attributed, vec![]), (Kind::Ambiguous, vec![in_place_of(3, "channel_delay", "torque_nm", 0.3)])]
    {
        let said = sentence(&Verdict { verdict: kind, alternatives, ..crowded() }, Vocabulary::RIG, false);
        assert!(said.split_whitespace().count() <= 60, "{} words: {said}", said.split_whitespace().count());
        assert!(said.contains("Most is left on voltage: 80.0 mV rms (slow).") && !said.contains("something is left"), "{said}");
        assert!(!said.contains("creeps"), "two causes at the most: {said}");
    }
    // a curve without a name on a small remainder does not hide a large one
    let curve = effect("unknown", "thrust_n", 0.9, 0.1, vec![]);
    let v = Verdict { unexplained: crowded().unexplained, ..verdict(Kind::Unattributed, vec![curve]) };
    let said = sentence(&v, Vocabulary::RIG, false);
    assert_eq!(
        said,
        "No known effect explains what the model leaves over. Most is left on voltage: 80.0 mV rms (slow). A smooth term without a name was fitted on thrust; it goes with time."
    );
}

#[test]
fn the_likeliest_heads_the_page() {
    let several = |sag_p: f64, other: f64| {
        let run = |run: &str| Validation { run: run.into(), channels: std::collections::BTreeMap::new() };
        let mut v = verdict(Kind::Ambiguous, vec![filter(0.99), sag(sag_p)]);
        v.alternatives = vec![in_place_of(1, "battery_discharge", "voltage_v", other)];
        v.runs = vec![run("a.csv"), run("b.csv")];
        sentence(&v, Vocabulary::RIG, false)
    };
    for (sag_p, other, asked) in [
        (
            0.47,
            0.53,
            "Either the battery runs down during the run, or the supply lead drops 41 mV per ampere: these runs cannot tell.",
        ),
        (
            0.53,
            0.47,
            "Either the supply lead drops 41 mV per ampere, or the battery runs down during the run: these runs cannot tell.",
        ),
        (
            0.2,
            0.7,
            "Perhaps the battery runs down during the run, or, less likely, the supply lead drops 41 mV per ampere: these runs cannot tell.",
        ),
    ] {
        assert!(several(sag_p, other).contains(asked), "{}", several(sag_p, other));
    }
    // what is likelier to be nothing than any name
    let mut v = verdict(Kind::Ambiguous, vec![filter(0.3)]);
    v.alternatives = vec![in_place_of(0, "channel_delay", "thrust_n", 0.1)];
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.starts_with("Either what is left on thrust has no cause of its own, or the load cell reads"), "{said}");
    // nor does such a name head the page of a verdict that stands
    let v = Verdict { verdict: Kind::Attributed, ..Verdict { effects: vec![filter(0.3), sag(0.99)], ..v } };
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.starts_with("The supply lead drops 41 mV per ampere.") && !said.contains("load cell"), "{said}");
}

#[test]
fn a_rival_stands_against_its_own_channel() {
    let torque = effect("channel_filter", "torque_nm", 0.34, 0.2, vec![parameter("tau", 0.072, 0.01, "s")]);
    let mut v = verdict(Kind::Ambiguous, vec![filter(0.6), torque]);
    v.alternatives = vec![in_place_of(1, "channel_delay", "torque_nm", 0.3), in_place_of(0, "channel_delay", "thrust_n", 0.2)];
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.contains("or the torque cell answers late") && !said.contains("the load cell answers late"), "{said}");
    let text = terminal(&v, Vocabulary::RIG, false);
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    for told in [
        "channel_delay in the place of channel_filter on torque (0.30)",
        "channel_delay in the place of channel_filter on thrust (0.20)",
    ] {
        assert!(text.contains(told), "{text}");
    }
}

/// A cause whose size the run bounds only has the bound at the head.
/// What explains most of a third quantity, and a limit that the readings show, have no other place where they would be read.
#[test]
fn a_third_large_cause_and_a_limit_that_is_read_off_are_in_the_head() {
    let two = || vec![filter(0.99), sag(0.99)];
    let said = |third: EffectEntry| {
        let v = verdict(Kind::Attributed, two().into_iter().chain([third]).collect());
        sentence(&v, Vocabulary::RIG, false)
    };
    let heat = |reduction: f64| effect("thermal_derate", "current_a", 0.99, reduction, vec![]);
    assert!(said(heat(0.6)).contains("the motor slows down as it heats up"), "{}", said(heat(0.6)));
    assert!(!said(heat(0.4)).contains("heats up"), "{}", said(heat(0.4)));
    let on_the_thrust = effect("creep", "thrust_n", 0.99, 0.6, vec![]);
    assert!(!said(on_the_thrust.clone()).contains("creeps"), "{}", said(on_the_thrust));
    let mut limit = effect("current_limit", "current_a", 0.95, 0.0, vec![parameter("limit", 11.0, 0.1, "A")]);
    limit.equation = "current_a <= limit, voltage_v gives way [of the supply, read off its meters]".into();
    assert!(said(limit.clone()).contains("the supply holds the current to 11.0 A"), "{}", said(limit));
}

/// Beside an open question what takes more than the question does is no smaller cause.
#[test]
fn a_larger_cause_is_no_smaller_one() {
    let said = |reduction: f64| {
        let causes = vec![
            filter(0.99),
            effect("battery_discharge", "voltage_v", 0.99, reduction, vec![]),
            effect("creep", "thrust_n", 0.5, 0.2, vec![]),
        ];
        let alternatives = vec![in_place_of(2, "hysteresis", "thrust_n", 0.4)];
        sentence(&Verdict { alternatives, ..verdict(Kind::Ambiguous, causes) }, Vocabulary::RIG, false)
    };
    assert!(said(0.1).contains("A smaller cause is told below."), "{}", said(0.1));
    assert!(said(0.4).contains("One more cause is told below."), "{}", said(0.4));
}

#[test]
fn a_cause_has_a_size_or_a_bound() {
    let open = Parameter { ci95: [-0.05, 0.21], ..parameter("resistance", 0.08, 0.1, "ohm") };
    let said = sentence(
        &verdict(Kind::Attributed, vec![effect("supply_sag", "voltage_v", 0.99, 0.5, vec![open])]),
        Vocabulary::RIG,
        false,
    );
    assert!(said.starts_with("The supply lead probably sags with the current (resistance: up to 0.21 ohm)."), "{said}");
}

/// What may be of either sign has no direction and no size: it changes, and the interval stands on the card alone.
#[test]
fn an_interval_of_both_signs_is_not_in_the_head() {
    let sizes = vec![parameter("across", -0.02, 0.05, "N/(m/s)^2"), parameter("climb", 0.3, 0.01, "N/(m/s)")];
    let e = effect("translational_lift", "thrust_n", 0.99, 0.5, sizes);
    let said = sentence(&verdict(Kind::Attributed, vec![e.clone()]), ident::report::flight::VOCABULARY, false);
    assert!(
        said.starts_with("Thrust changes across the air and falls in a climb (") && said.contains("0.290 to 0.310"),
        "{said}"
    );
    assert!(!said.contains("-0.07"), "{said}");
    let sizes = vec![parameter("across", -0.2, 0.05, "N/(m/s)^2"), parameter("climb", -0.3, 0.01, "N/(m/s)")];
    let said = sentence(
        &verdict(Kind::Attributed, vec![EffectEntry { parameters: sizes, ..e }]),
        ident::report::flight::VOCABULARY,
        false,
    );
    assert!(said.starts_with("Thrust falls across the air and grows in a climb"), "{said}");
}

/// One amplifier of both cells of a stand is the load cell's, whichever of them comes first.
#[test]
fn the_meter_of_thrust_and_torque_is_the_load_cell() {
    let of =
        |channels: &[&str]| EffectEntry { channels: channels.iter().map(|c| (*c).to_owned()).collect(), ..filter(0.9) }.meter();
    assert_eq!(of(&["torque_nm", "thrust_n"]), "the load cell");
    assert_eq!(of(&["torque_nm"]), "the torque cell");
}

/// Single readings are told once for all channels and runs, apart from the causes.
#[test]
fn absurd_readings_are_one_account() {
    let of = |run: &str| EffectEntry {
        run: Some(run.into()),
        scope: Scope::Event,
        ..effect(
            "glitch_rows",
            "voltage_v",
            0.999,
            0.6,
            vec![parameter("count", 2.0, 0.0, "1"), parameter("size", 14.0, 18.0, "V")],
        )
    };
    let text = terminal(&verdict(Kind::Attributed, vec![sag(0.99), of("a.csv"), of("b.csv")]), Vocabulary::RIG, false);
    let (_, apart) = text.split_once("\nreadings set apart (glitch_rows)\n").expect("a part of its own");
    assert!(apart.starts_with("  The voltmeter holds absurd values in 2 rows in run a.csv.\n  The voltmeter"), "{apart}");
    assert!(!text.contains("not well known") && !text.contains("size ="), "{text}");
}

#[test]
fn a_channel_without_a_model_is_told() {
    let mut v = verdict(Kind::Attributed, vec![sag(0.99)]);
    v.channels.not_predicted.insert("rpm".into(), "no command was logged".into());
    // what no model predicts is not told as what a model leaves
    v.unexplained = vec![left("rpm", 380.0), left("voltage_v", 8.0)];
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.ends_with("On voltage 80.0 mV rms is left (slow). Speed has no model: no command was logged."), "{said}");
    v.unexplained.truncate(1);
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.ends_with("Little is left beyond the noise. Speed has no model: no command was logged."), "{said}");
}

/// Another run on which the model is ten floors off is told on terminal and page alike; one that is as near as its own is not.
#[test]
fn another_run_that_is_far_off_is_told() {
    let mut v = verdict(Kind::Attributed, vec![sag(0.99)]);
    let (name, own) =
        v.channels.iter().next().map(|(name, c)| (name.clone(), c.noise_floor_rms.max(c.after.heldout_rms))).expect("a channel");
    let validated = |after: f64| Validation {
        run: "other.csv".into(),
        channels: [(name.clone(), BeforeAfter { before: after, after })].into(),
    };
    v.validation = vec![validated(own)];
    assert!(!terminal(&v, Vocabulary::RIG, false).contains("far off"));
    v.validation = vec![validated(10.0 * own)];
    assert!(terminal(&v, Vocabulary::RIG, false).contains("On other.csv the model is far off on"));
}

#[test]
fn the_terminal_begins_with_the_sentence_and_keeps_to_its_width() {
    for (v, news, ..) in cases() {
        let text = terminal(&v, Vocabulary::RIG, news);
        let head = text.split("\nrun.csv\n").next().expect("a head").split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(head, sentence(&v, Vocabulary::RIG, news));
        let widest = text.lines().max_by_key(|l| l.chars().count()).expect("lines");
        assert!(widest.chars().count() <= WIDEST, "{widest}");
        assert!(v.unexplained.is_empty() || text.contains("what is left"), "{text}");
    }
}

/// What could stand in the place of a name is told beneath it, as on its card; what is hardly likely is not.
#[test]
fn the_terminal_tells_the_rival_of_a_name() {
    let mut v = verdict(Kind::Attributed, vec![sag(0.7)]);
    let told = |v: &Verdict| terminal(v, Vocabulary::RIG, false).split_whitespace().collect::<Vec<_>>().join(" ");
    v.alternatives = vec![Alternative { ids: vec!["battery_discharge".into()], probability: 0.2, change: None }];
    assert!(told(&v).contains("or else: the battery runs down during the run (p 0.20)"), "{}", told(&v));
    v.alternatives[0].probability = 0.01;
    assert!(!told(&v).contains("or else:"), "{}", told(&v));
}

/// What has no name is sure of nothing, and what cannot be below zero has an upper bound.
#[test]
fn the_terminal_claims_no_more_than_it_knows() {
    let lag = effect("spinup_lag", "thrust_n", 0.9, 0.5, vec![parameter("tau_up", 0.002, 0.0233, "s")]);
    let text = terminal(
        &verdict(Kind::Attributed, vec![lag, effect("unknown", "thrust_n", 0.999, 0.4, vec![])]),
        Vocabulary::RIG,
        false,
    );
    assert!(text.contains("unknown (that something is there: p > 0.99) on thrust"), "{text}");
    let seen = EffectEntry {
        evidence: "the residual goes up; without it the held-out error of voltage_v is 6.76 times as large".into(),
        ..sag(0.9)
    };
    let told = terminal(&verdict(Kind::Attributed, vec![seen]), Vocabulary::RIG, false);
    assert!(told.contains("why: the residual goes up\n") && told.contains("Without it the error of voltage is"), "{told}");
    assert!(text.contains("tau_up < 25 ms  (95 %)") && !text.contains("-0.02") && !text.contains("-21"), "{text}");
}

/// Every effect of the library says its clause with and without numbers.
#[test]
fn every_effect_has_words() {
    let verb = |text: &str| text.split_whitespace().count() >= 2;
    for e in ident::effects::library() {
        let clause = e.said(&effect(e.id(), "thrust_n", 0.9, 0.5, vec![]));
        assert!(verb(&clause.with("")) && !clause.with("").contains('_'), "{}: {clause:?}", e.id());
        assert!(!clause.who.is_empty(), "{}: an adverb needs a place", e.id());
    }
}

#[test]
fn a_demonstration_judges_its_names() {
    let hidden = |id: &str| Hidden { seed: 7, id: id.into(), parameters: vec!["resistance = 0.041 ohm".into()] };
    let lag = effect("spinup_lag", "rpm", 0.9, 0.5, vec![]);
    let row = EffectEntry { kin: Kin::WithinRow, ..effect("channel_delay", "thrust_n", 0.9, 0.2, vec![]) };
    let v = verdict(Kind::Attributed, vec![sag(0.9), lag, filter(0.9), row]);
    let said = hidden("supply_sag").judged(&v).join("\n");
    for word in [
        "hidden was supply_sag: found",
        "hidden with resistance = 0.041 ohm",
        "found with resistance = ",
        "true of every rig, the simulated one too: spinup_lag",
        "where in its row a reading lies, no effect that anybody hides: channel_delay",
        "named, and false (nobody hid it): channel_filter",
    ] {
        assert!(said.contains(word), "{said}");
    }
    assert!(!said.contains("outside the interval"), "{said}");
    let other = Hidden { parameters: vec!["resistance = 0.05 ohm".into()], ..hidden("supply_sag") };
    let said = other.judged(&v).join("\n");
    assert!(said.contains("what was hidden lies outside the interval of resistance"), "{said}");
    assert!(hidden("creep").judged(&v)[0].starts_with("hidden was creep: NOT FOUND"));
}

/// Every effect of a flight says what it does, with its size where the flight shows it.
#[test]
fn every_effect_of_a_flight_has_words() {
    let words = ident::report::flight::VOCABULARY;
    for e in ident::flight::effects::library() {
        let clause = (words.clause)(&effect(e.id(), "force_x", 0.9, 0.5, vec![]));
        assert!(!clause.who.is_empty() && !clause.does.is_empty(), "{}: {clause:?}", e.id());
    }
    let offset = |z: f64| {
        ["x", "y", "z"].map(|axis| parameter(&format!("offset_{axis}"), if axis == "z" { z } else { 12.0 }, 0.5, "uT")).to_vec()
    };
    let said = |id: &str, parameters: Vec<Parameter>| (words.clause)(&effect(id, "mag_x", 0.9, 0.5, parameters)).sentence();
    assert_eq!(said("hard_iron", offset(9.0)), "A magnet on board adds 19.2 uT to the field.");
    let weaker = vec![parameter("rotor", 3.0, 0.0, "1"), parameter("thrust_change", -0.1, 0.004, "1")];
    assert_eq!(said("rotor_gain", weaker), "Rotor 3 gives 10.0 % less thrust than it should.");
    let sagging = vec![parameter("resistance", 0.02, 0.0002, "ohm")];
    assert_eq!(said("supply_sag", sagging), "The supply's voltage drops by 20.0 mV for each ampere drawn.");
    assert_eq!(said("supply_sag", Vec::new()), "The supply's voltage drops with the load.");
    let unknown_size = vec![parameter("offset_x", 0.001, 0.01, "m"), parameter("offset_y", 0.002, 0.01, "m")];
    assert_eq!(said("mass_offset", unknown_size), "The centre of gravity lies off the middle.");
}

/// Where nothing moved a model that fits has explained nothing.
#[test]
fn a_run_in_which_nothing_moved_explains_nothing() {
    let rest = "Nothing moved: the motor never turned. This run shows nothing of the powerplant.";
    let held = "Nothing moved: the command stayed where it was. This run shows nothing of how the powerplant follows it.";
    for (at_rest, still) in [(true, rest), (false, held)] {
        let of = |kind: Kind| Verdict { at_rest, held: !at_rest, ..verdict(kind, vec![]) };
        for news in [false, true] {
            assert_eq!(sentence(&of(Kind::None), Vocabulary::RIG, news), still);
        }
        let loud = sentence(&of(Kind::Unattributed), Vocabulary::RIG, false);
        assert!(loud.starts_with(&format!("{still} Something")), "{loud}");
    }
}

/// The head of a page has two lines; causes that these have no room for stand in the paragraph beneath.
#[test]
fn a_head_holds_as_many_causes_as_two_lines_do() {
    let effects = || {
        let sized =
            |id: &str, on: &str, name: &str, unit: &str| effect(id, on, 0.95, 0.9, vec![parameter(name, 0.5, 0.01, unit)]);
        vec![
            sized("supply_sag", "voltage_v", "resistance", "ohm"),
            sized("channel_filter", "thrust_n", "window", "s"),
            sized("channel_delay", "current_a", "delay", "s"),
        ]
    };
    let said = |n: usize, news: bool| {
        let mut v = verdict(Kind::Attributed, vec![]);
        v.effects = effects().into_iter().take(n).collect();
        let said = sentence(&v, Vocabulary::RIG, news);
        let (head, rest) = said.split_once(". ").map_or((said.as_str(), ""), |(head, rest)| (head, rest));
        (head.to_owned(), rest.to_owned())
    };
    let (short, rest) = said(2, false);
    assert!(short.contains(", and ") && !rest.contains("Beside that"), "{short} | {rest}");
    for (n, news, further) in [(3, false, "Beside that, "), (3, true, "New as well: ")] {
        let (head, rest) = said(n, news);
        assert!(head.chars().count() < 130 && rest.starts_with(further), "{head} | {rest}");
    }
}

/// A size is told without its sign: a word tells the direction.
#[test]
fn sizes_have_no_sign() {
    let said = |id: &str, name: &str, value: f64, unit: &str| {
        let found = effect(id, "thrust_n", 0.95, 0.5, vec![parameter(name, value, 0.01 * value.abs(), unit)]);
        (Vocabulary::RIG.clause)(&found).sentence()
    };
    for (id, name, unit, up, down) in [
        ("zero_drift", "rate", "N/s", "drifts up by 1.20 N a minute", "drifts down by 1.20 N a minute"),
        ("tare_shift", "offset", "N", "jumps up by 0.0200 N", "jumps down by 0.0200 N"),
        ("gain_change", "gain_change", "1", "rises by 2.00 %", "falls by 2.00 %"),
        ("blade_damage", "thrust_change", "1", "adds 2.00 % of the thrust", "takes 2.00 % of the thrust"),
        ("thermal_zero", "coefficient", "N/K", "rises by 0.0200 N per kelvin", "falls by 0.0200 N per kelvin"),
        (
            "reynolds_thrust",
            "exponent",
            "1",
            "grows faster with the speed than declared, by the speed to the power of 0.0200",
            "grows slower",
        ),
    ] {
        let [above, below] = [0.02, -0.02].map(|v| said(id, name, v, unit));
        assert!(above.contains(up) && below.contains(down), "{above} / {below}");
    }
}

/// The terms of a rig's or a flight's curve are seen in its figure; those of an attitude log's correction have words.
#[test]
fn terms_of_a_curve_are_not_told() {
    let curve = effect("unknown", "thrust_n", 0.9, 0.4, vec![parameter("p1", 0.5, 0.01, "N")]);
    let v = verdict(Kind::Unattributed, vec![curve]);
    for words in [Vocabulary::RIG, ident::report::flight::VOCABULARY] {
        assert!(!terminal(&v, words, false).contains("p1 ="));
    }
    let linear = effect("unknown", "gx", 0.9, 0.4, vec![parameter("gx_ax", 0.5, 0.01, "1")]);
    let v = verdict(Kind::Unattributed, vec![linear]);
    assert!(terminal(&v, ident::report::inertial::VOCABULARY, false).contains("gx_ax = 0.50"));
}

/// What is told of several sensors of one speed, or of the axes of a vector, is told of the whole.
#[test]
fn a_share_is_that_of_the_whole_quantity() {
    let mut v = verdict(Kind::Attributed, vec![effect("spinup_lag", "rpm_hall", 0.99, 0.9, vec![])]);
    let of = |rms: f64| Figures { rms, heldout_rms: rms, across_runs_rms: None, whiteness_p: 0.2 };
    for (name, after) in [("rpm_hall", 1.0), ("rpm_beam", 10.0)] {
        let channel = Channel { unit: "rev/min".into(), noise_floor_rms: 1.0, before: of(20.0), after: of(after) };
        v.channels.predicted.insert(name.into(), channel);
    }
    let said = sentence(&v, Vocabulary::RIG, false);
    // 1 - (0 + 99)/(399 + 399)
    assert!(said.contains("88 % of what the speeds had left over"), "{said}");
}

/// A channel of which the state says that little is left, over all runs, is not told as loud for the one run on which it is.
#[test]
fn the_sentence_counts_what_the_state_calls_unexplained() {
    let mut v = verdict(Kind::Attributed, vec![sag(0.9)]);
    v.unexplained = vec![left("thrust_n", 9.0), left("voltage_v", 8.0)];
    if let Some(thrust) = v.channels.predicted.get_mut("thrust_n") {
        thrust.after.heldout_rms = 0.02;
    }
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.contains("On voltage 80.0 mV rms is left (slow).") && !said.contains("thrust"), "{said}");
}

/// A share of a whole vector does not hide that one of its axes is worse for it.
#[test]
fn an_axis_that_is_worse_is_told() {
    let mut v = verdict(Kind::Attributed, vec![effect("hard_iron", "mz", 0.99, 0.7, vec![])]);
    let of = |rms: f64| Figures { rms, heldout_rms: rms, across_runs_rms: None, whiteness_p: 0.2 };
    let axis =
        |before: f64, after: f64| Channel { unit: "uT".into(), noise_floor_rms: 0.2, before: of(before), after: of(after) };
    v.channels.predicted =
        [("mx", axis(3.56, 2.27)), ("my", axis(3.40, 3.47)), ("mz", axis(14.1, 3.70))].map(|(n, c)| (n.to_owned(), c)).into();
    let said = sentence(&v, ident::report::inertial::VOCABULARY, false);
    assert!(said.contains("of what field had left over. Field (y) is predicted 2 % worse."), "{said}");
}

/// What is left looks like what it does on the sensor whose size is told.
#[test]
fn a_size_and_its_look_are_of_one_sensor() {
    let mut v = verdict(Kind::Attributed, vec![sag(0.9)]);
    let of = |rms: f64| Figures { rms, heldout_rms: rms, across_runs_rms: None, whiteness_p: 0.2 };
    for (name, floor, after) in [("rpm_hall", 1.0, 8.0), ("rpm_beam", 1.5, 9.0)] {
        let channel = Channel { unit: "rpm".into(), noise_floor_rms: floor, before: of(20.0), after: of(after) };
        v.channels.predicted.insert(name.into(), channel);
    }
    let on_its_way = Unexplained { looks_like: "while the load is on its way".into(), ..left("rpm_beam", 6.0) };
    v.unexplained = vec![Unexplained { looks_like: "in single rows".into(), ..left("rpm_hall", 8.0) }, on_its_way];
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.contains("up to 9.00 rev/min rms is left (as the load changes)"), "{said}");
}

/// Rotors of which the same is told have one entry.
#[test]
fn what_is_alike_but_for_its_channel_is_told_once() {
    let rotor = |k: usize| effect("unknown", &format!("rpm_{k}"), 0.999, 0.4, vec![]);
    let mut v = verdict(Kind::Unattributed, vec![rotor(1), rotor(2), rotor(3), rotor(4)]);
    let one = v.channels.predicted["thrust_n"].clone();
    for k in 1..=4 {
        let after = if k == 4 { Figures { heldout_rms: 0.2, ..one.after } } else { one.after };
        v.channels.predicted.insert(format!("rpm_{k}"), Channel { after, ..one.clone() });
    }
    let text = terminal(&v, ident::report::flight::VOCABULARY, false).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains("on speed of rotors 1, 2 and 3, vehicle Without it the error of speed of rotor 1 is"), "{text}");
    assert!(text.contains("The others are alike.") && text.contains("on speed of rotor 4, vehicle"), "{text}");
    assert_eq!(text.matches("unknown (").count(), 2, "{text}");
}

/// What began within a run is not told as of every run, and of sizes of which none is known the effect alone is sure.
#[test]
fn an_effect_of_a_board_claims_no_more_than_its_intervals() {
    let z = parameter("offset_z", 17.9, 6.0, "uT");
    let magnet = effect("hard_iron", "mz", 0.999, 0.2, vec![z, parameter("t0", 40.8, 1.8, "s")]);
    assert!(ident::verdict::words::scope(&magnet, "board").starts_with("since one instant"));
    let said = (ident::report::inertial::VOCABULARY.clause)(&magnet).sentence();
    assert!(said.ends_with("to the field from 41 s on."), "{said}");
    let sizes = |clear: f64| [clear, 0.011, 0.024, 0.021].map(|v| parameter("s_xy", v, 0.035, "1")).to_vec();
    let iron = |clear: f64| {
        let v = verdict(Kind::Attributed, vec![effect("soft_iron", "thrust_n", 0.999, 0.05, sizes(clear))]);
        terminal(&v, ident::report::inertial::VOCABULARY, false).split_whitespace().collect::<Vec<_>>().join(" ")
    };
    assert!(iron(0.05).contains("of its 4 sizes 3 may each be zero"), "{}", iron(0.05));
    assert!(!iron(0.2).contains("may each be zero"), "one is well known: {}", iron(0.2));
}

/// Floors that are guesses, and floors that no sensor has, are told before the figures.
#[test]
fn floors_that_are_no_measure_are_told() {
    let plain = verdict(Kind::Attributed, vec![sag(0.9)]);
    let said = |v: &Verdict| terminal(v, Vocabulary::RIG, false).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(!said(&plain).contains("guesses") && !said(&plain).contains("16-bit"));
    assert!(said(&Verdict { guessed_floors: Some(11), ..plain.clone() }).contains("Only 11 rows, one for each level"));
    let erring = |share: f64| said(&Verdict { sensor_share: Some(share), ..plain.clone() });
    assert!(erring(0.976).contains("Of what the speed sensor reads off the course of a level, 98 % is its own error"));
    assert!(!erring(0.2).contains("its own error"));
    let mut silent = plain;
    if let Some(c) = silent.channels.predicted.get_mut("voltage_v") {
        c.noise_floor_rms = 1e-6;
    }
    assert!(
        said(&silent).contains("Voltage: the noise floor lies beneath the rounding of any 16-bit sensor"),
        "{}",
        said(&silent)
    );
}

/// A correction without a name is told as a curve, not by its polynomials.
#[test]
fn a_curve_has_words() {
    let mut curve = effect("unknown", "rpm", 0.9, 0.4, vec![]);
    curve.equation = "reading += sum of p_k P_k(v) [pulse_us, terms 3]".into();
    assert_eq!(ident::verdict::words::curve(&curve).as_deref(), Some("a smooth curve of pulse, 3 terms"));
    curve.equation = "no correction".into();
    assert_eq!((ident::verdict::words::curve(&curve), ident::verdict::words::curve(&sag(0.9))), (None, None));
}

/// Of several runs what happened on one alone names it, on the terminal and at the head.
#[test]
fn an_event_of_one_run_names_its_run() {
    let slip = EffectEntry {
        scope: Scope::Event,
        run: Some("day2.csv".into()),
        ..effect(
            "tare_shift",
            "thrust_n",
            0.95,
            0.7,
            vec![parameter("offset", 0.15, 0.002, "N"), parameter("t0", 47.2, 0.4, "s")],
        )
    };
    let v = verdict(Kind::Attributed, vec![slip]);
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.contains("jumps up by 0.150 N at 47.2 s in run day2.csv"), "{said}");
    assert!(terminal(&v, Vocabulary::RIG, false).contains("in run day2.csv"), "{said}");
}

/// A channel that has no model has nothing left over.
#[test]
fn what_is_not_predicted_is_not_left() {
    let mut v = verdict(Kind::Attributed, vec![sag(0.9)]);
    v.channels.not_predicted.insert("rpm".into(), "no command was logged".into());
    v.unexplained = vec![left("rpm", 812.4)];
    let text = terminal(&v, Vocabulary::RIG, false);
    assert!(!text.contains("812") && !text.contains("what is left") && text.contains("no command was logged"), "{text}");
}

/// Names of columns become words; formulas and words stay.
#[test]
fn a_text_is_told_without_names_of_columns() {
    let said = ident::verdict::words::plain("the thrust_n residual follows temp_c, as thrust(rpm) holds; time_since_step");
    assert_eq!(said, "the thrust residual follows temperature, as thrust against the speed holds; time since the last step");
    assert_eq!(ident::verdict::words::channel("mz"), "field (z)");
    let late = effect("channel_delay", "mx", 0.9, 0.5, vec![parameter("delay", 0.011, 0.001, "s")]);
    assert_eq!((ident::report::flight::VOCABULARY.clause)(&late).sentence(), "The magnetometer answers 11 ms late.");
}

/// A flight's text speaks of the vehicle and of its quantities, not of a rig and of columns.
#[test]
fn a_flight_is_of_a_vehicle() {
    let mut lag = effect("spinup_lag", "rpm_1", 0.9, 0.7, vec![]);
    lag.evidence = "the speed is late; without it the held-out error of acc_x is 3.00 times as large".into();
    let mut v = verdict(Kind::Attributed, vec![lag]);
    let one = v.channels.predicted["thrust_n"].clone();
    v.channels.predicted = [("acc_x".to_owned(), one.clone()), ("rpm_1".to_owned(), one)].into();
    let text = terminal(&v, ident::report::flight::VOCABULARY, false).split_whitespace().collect::<Vec<_>>().join(" ");
    for said in ["What every vehicle has:", "what every vehicle has", "on speed of rotor 1, vehicle"] {
        assert!(text.contains(said), "{said}: {text}");
    }
    assert!(!text.contains("rig"), "{text}");
    let mut v = verdict(Kind::Attributed, vec![effect("hard_iron", "mx", 0.9, 0.7, vec![])]);
    let one = v.channels.predicted["thrust_n"].clone();
    v.channels.predicted = [("mx".to_owned(), one)].into();
    let text = terminal(&v, ident::report::inertial::VOCABULARY, false);
    assert!(text.contains("what this board has") && text.contains("on field (x), board"), "{text}");
}

/// A verdict on a sensor that misses pulses: its own scatter is the fault, and its worst readings were set aside.
fn missing_pulses() -> Verdict {
    let fault = effect("missed_pulses", "rpm_opto", 0.99, 0.01, vec![parameter("probability", 0.0124, 0.002, "1")]);
    let mut v = verdict(Kind::Attributed, vec![fault]);
    let of = |rms: f64| Figures { rms, heldout_rms: rms, across_runs_rms: None, whiteness_p: 0.2 };
    for (name, floor, after) in [("rpm_hall", 0.6, 0.7), ("rpm_beam", 0.5, 0.6), ("rpm_opto", 157.0, 176.0)] {
        let channel = Channel { unit: "rev/min".into(), noise_floor_rms: floor, before: of(after), after: of(after) };
        v.channels.predicted.insert(name.into(), channel);
    }
    let aside = |rows: usize| SetAside {
        channel: "rpm_opto".into(),
        row: 100,
        rows,
        t_s: 10.0,
        until_s: 10.5,
        value: 1642.17,
        expected: 2464.06,
        recurs: false,
        silent: false,
        stuck: false,
        timeless: false,
        readings: vec![1642.17; rows],
    };
    v.set_aside = vec![aside(4), aside(3)];
    v
}

/// Readings that were set aside because the fault struck them are told with the fault, and the bar of the sensor does not look healthy.
#[test]
fn what_was_set_aside_is_told_with_the_fault() {
    let v = missing_pulses();
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.contains("misses 1.2 % of its pulses, counting 7 readings set aside as too low."), "{said}");
    let text = terminal(&v, Vocabulary::RIG, false);
    let row = text.lines().find(|l| l.starts_with("speed (optical)")).unwrap_or_default();
    assert!(row.ends_with("fault stays") && row.contains("0.550 rev/min"), "{row}");
    let joined = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(joined.contains("1642 where the rest of the log says 2464"), "{text}");
    assert!(text.lines().all(|l| l.chars().count() <= WIDEST), "{text}");
}

/// Rows that lie beyond what a fit saw are missed by far more than those it saw: both are told, and which is which.
#[test]
fn an_extrapolation_is_no_size_of_what_is_left() {
    let mut v = verdict(Kind::Attributed, vec![sag(0.9)]);
    let after = Figures { rms: 4.1, heldout_rms: 91.0, across_runs_rms: None, whiteness_p: 0.2 };
    let before = Figures { rms: 80.0, heldout_rms: 160.0, ..after };
    v.channels.predicted.insert("rpm".into(), Channel { unit: "rev/min".into(), noise_floor_rms: 1.0, before, after });
    v.unexplained = vec![left("rpm", 91.0)];
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.contains("On speed 91.0 rev/min rms is left (slow). On the rows of the fit it is 4.10 rev/min:"), "{said}");
    let text = terminal(&v, Vocabulary::RIG, false);
    assert!(text.contains("speed: 91.0 rev/min (4.10 rev/min where fitted)"), "{text}");
}

/// A size that is true of no run is told with those of the runs.
#[test]
fn a_mean_of_runs_that_disagree_is_told_as_one() {
    let mut lead = sag(0.995);
    lead.parameters[0].ci95 = [0.5 * lead.parameters[0].value, 1.5 * lead.parameters[0].value];
    lead.evidence += "; the runs disagree: alone they have 0.0799 to 0.200 ohm for the resistance";
    let said = sentence(&verdict(Kind::Attributed, vec![lead.clone()]), Vocabulary::RIG, false);
    assert!(said.contains(" per ampere on average, and the runs disagree (0.0799 to 0.200 ohm)."), "{said}");
    lead.parameters[0].ci95 = [0.95 * lead.parameters[0].value, 1.05 * lead.parameters[0].value];
    let said = sentence(&verdict(Kind::Attributed, vec![lead]), Vocabulary::RIG, false);
    assert!(!said.contains("disagree"), "{said}");
}

/// A noise floor may hold a part of what is named: all that is explained is what stood above it.
#[test]
fn all_is_what_stood_above_the_noise_floor() {
    let mut v = verdict(Kind::Attributed, vec![filter(0.99)]);
    if let Some(thrust) = v.channels.predicted.get_mut("thrust_n") {
        thrust.after.heldout_rms = 0.0099;
    }
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.contains("That explains all of what thrust had left above its noise floor."), "{said}");
}

/// A lead acts on speed, current and voltage: the reader looks at the voltage first.
#[test]
fn against_a_model_a_share_is_told_of_every_quantity_that_was_plain() {
    let mut of = verdict(Kind::Attributed, vec![sag(0.95)]);
    of.effects[0].channels = vec!["thrust_n".into(), "voltage_v".into()];
    let said = sentence(&of, Vocabulary::RIG, true);
    assert!(said.contains("of what thrust and voltage had left over"), "{said}");
    assert!(sentence(&of, Vocabulary::RIG, false).contains("of what thrust had left over"), "the first channel alone");
    // two floors were nothing to look at
    if let Some(c) = of.channels.predicted.get_mut("voltage_v") {
        c.before.heldout_rms = 0.02;
        c.after.heldout_rms = 0.01;
    }
    let said = sentence(&of, Vocabulary::RIG, true);
    assert!(said.contains("of what thrust had left over"), "{said}");
}

/// Behind steps every rig has a rest, be it the loudest: what is left where the load is held is what nobody expects.
#[test]
fn what_is_left_where_the_load_is_held_comes_first() {
    let mut v =
        verdict(Kind::Attributed, vec![effect("spinup_lag", "voltage_v", 1.0, 0.5, vec![parameter("tau_up", 0.05, 0.01, "s")])]);
    let looks = |channel: &str, over_floor: f64, looks_like: &str| Unexplained {
        looks_like: looks_like.into(),
        ..left(channel, over_floor)
    };
    v.unexplained = vec![looks("voltage_v", 8.0, "right behind steps of the command"), looks("thrust_n", 3.04, "slow")];
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.starts_with("Nothing of this rig's own was named. Where the load is held, most is left on thrust: "), "{said}");
    let text = terminal(&v, Vocabulary::RIG, false);
    assert!(text.contains("left at steps") && text.contains("unexplained rest"), "{text}");
    // with nothing else the steps are told
    v.unexplained.truncate(1);
    v.channels.predicted.remove("thrust_n");
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.contains("On voltage 80.0 mV rms is left (right behind steps of the command)"), "{said}");
}

/// An alternative that has all the names and one more puts none of them in doubt.
#[test]
fn what_may_be_there_as_well_is_told_as_that() {
    let mut v = verdict(Kind::Ambiguous, vec![sag(0.99)]);
    v.alternatives = vec![alternative(&["supply_sag", "channel_delay"], 0.05)];
    let said = sentence(&v, Vocabulary::RIG, false);
    assert!(said.starts_with("The supply lead drops 41 mV per ampere."), "{said}");
    assert!(said.contains(" as well: this run cannot tell") && !said.contains("not sure"), "{said}");
}
