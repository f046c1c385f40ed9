//! `battery_discharge`: the battery empties during the run.
//!
//! What it is: voltage_v falls with the charge drawn, along the cells' open-circuit curve, and the speed at a given pulse follows the voltage; the
//! current at a speed rises by what is known of brushless motors. The curve is that of lithium-polymer cells ([`super::cell`]), which the capacity
//! alone places, or, for other cells, a straight line or a parabola over the part that a run covers.
//! What can go wrong: whatever else drifts with time looks like it on speed and current, so these may not follow by more than the voltage falls.
//! The capacity follows from the slope only as well as one knows the cell's curve: 15 % are added to its error.
//! Units: V/Ah, V/Ah2, Ah; `follows` is a share of the share that the voltage falls by.
//! Reference: open-circuit voltage of lithium-polymer cells falls by 0.65 V +- 15 % per unit of charge between full and the
//! knee: 4.20 V full, 3.87 V at 50 % (Chen & Rincon-Mora 2006, Fig. 8, and common discharge tables).

use crate::channel::{Context, Relation};
use crate::effects::design::{Label, TargetDesign};
use crate::effects::supply::cell::Pack;
use crate::effects::supply::supply_voltage::{CURRENT_BY_SPEED, OF_SPEED};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, present, speeds};
use crate::numeric::solve::Normal;

/// See the module.
pub(crate) struct BatteryDischarge;

/// Mean voltage of a cell in use, V: what the number of cells is counted by.
const CELL_V: f64 = 3.95;
/// Fall of one cell's open-circuit voltage per unit of charge, V, and how well it is known.
const CELL_SLOPE: (f64, f64) = (0.65, 0.15);

/// Share of the speed over a whole run within which a loss is none.
const LEAST_LOSS: f64 = 0.02;

impl Effect for BatteryDischarge {
    fn id(&self) -> &'static str {
        "battery_discharge"
    }

    fn about(&self) -> About {
        About {
            title: "Battery discharges during the run",
            equation: "voltage_v = V0 - slope q - bend q^2, rpm(pulse) *= 1 - speed_loss q, current_a *= 1 + 0.875 speed_loss q; lithium cells: voltage_v = V0 - U(0) + U(q / capacity), U the open-circuit voltage, rpm(pulse) *= 1 - follows (1 - U(q / capacity) / U(0)), current_a the other way by 0.875 of it; q the charge drawn",
            source: "open-circuit voltage of lithium-polymer cells, Chen & Rincon-Mora 2006",
            depends_on: &["charge"],
            signature: "voltage and speed at the same pulse fall together, fastest at high current, and never come back",
            look_alikes: &["supply_sag", "thermal_derate"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the battery",
            found.tell(
                "slope",
                |v| format!("loses {v} as it empties").replace("V/Ah", "V per ampere hour"),
                "runs down during the run",
            ),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn follows_supply(&self, instance: &Instance, channel: &str) -> bool {
        instance.form != OTHER_SUPPLY && channel != "voltage_v" && instance.touches(channel)
    }

    fn stage(&self) -> Stage {
        Stage::Gain
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if context.time_is_row || context.draw().is_none() || present(context, &["voltage_v"]).is_empty() {
            return Vec::new();
        }
        let mut channels = vec!["voltage_v"];
        channels.extend(present(context, &["current_a"]));
        channels.extend(speeds(context));
        let forms: &[&str] = if context.against_model { &[OTHER_SUPPLY] } else { &[STRAIGHT, CURVED, LITHIUM] };
        // where something else drifts on speed or current, the voltage alone still tells of the battery; not so in a table of levels, where charge
        // and current rise together, and not against a model, where another supply moves the speed
        let alone = channels.len() > 1 && !context.is_table() && !context.against_model;
        let sets = if alone { vec![channels.as_slice(), &channels[..1]] } else { vec![channels.as_slice()] };
        sets.iter().flat_map(|set| forms.iter().map(|form| Instance::new(set, form))).collect()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        let total = charge(context).last().copied().unwrap_or(0.0).max(1e-6);
        let beyond_voltage = instance.channels.iter().any(|c| c.starts_with("rpm") || c == "current_a");
        if instance.form == LITHIUM {
            let least = LEAST_LOSS / (fall(context) * total).max(LEAST_LOSS);
            let follows = Shape { name: "follows", unit: "1", range: (-least, 1.5), starts: vec![0.1, 0.5, 1.0] };
            return std::iter::once(capacity(context, total)).chain(beyond_voltage.then_some(follows)).collect();
        }
        if !beyond_voltage {
            return Vec::new();
        }
        // a motor at a held duty turns no slower than its voltage falls
        let most = fall(context).max(LEAST_LOSS / total);
        let starts = [0.02, 0.1, 0.3, 0.7].map(|k| k * most).to_vec();
        let loss = Shape { name: "speed_loss", unit: "1/Ah", range: (-LEAST_LOSS / total, 1.5 * most), starts };
        if instance.form != OTHER_SUPPLY {
            return vec![loss];
        }
        let level = Shape { name: "speed_level", unit: "1", range: (-0.4, 0.4), starts: vec![-0.1, -0.03, 0.0, 0.03, 0.1] };
        vec![loss, level]
    }

    /// A motor at a held duty follows its supply as it does on any other.
    fn prior(&self, _: &Context, instance: &Instance, shape: &[f64]) -> f64 {
        match shape {
            [_, follows, ..] if instance.form == LITHIUM => -0.5 * ((follows - OF_SPEED.0) / OF_SPEED.1).powi(2),
            _ => 0.0,
        }
    }

    fn amplitudes(&self, instance: &Instance) -> Vec<Amplitude> {
        let mut out = vec![Amplitude { name: "slope", unit: "V/Ah" }, Amplitude { name: "bend", unit: "V/Ah2" }];
        match instance.form.as_str() {
            STRAIGHT => out.truncate(1),
            LITHIUM => out.clear(),
            _ => {}
        }
        if instance.form == OTHER_SUPPLY {
            out.push(Amplitude { name: "level", unit: "V" });
            out.push(Amplitude { name: "current_level", unit: "A/krpm3" });
            out.push(Amplitude { name: "resistance", unit: "ohm" });
        }
        out
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let charge = charge(context);
        let other = instance.form == OTHER_SUPPLY;
        if instance.form == LITHIUM {
            return empties(context, &charge, shape, design);
        }
        let scale = |design: &mut TargetDesign, of: &dyn Fn(f64) -> f64| {
            design.map_columns(|column| column.iter().zip(&charge).map(|(v, q)| v * of(*q)).collect());
        };
        match (design.relation, shape) {
            (Relation::Voltage, _) => {
                design.add(position, 0, charge.iter().map(|q| -q).collect());
                if instance.form != STRAIGHT {
                    design.add(position, 1, charge.iter().map(|q| -q * q).collect());
                }
                if other {
                    design.add(position, 2, vec![1.0; charge.len()]);
                    if let Some((current, _)) = context.draw() {
                        design.add(position, 4, current.iter().map(|i| -i).collect());
                    }
                }
            }
            (Relation::Current, [loss, ..]) => {
                scale(design, &|q| 1.0 + CURRENT_BY_SPEED * loss * q);
                if other {
                    design.add(position, 3, context.rpm.iter().map(|r| (r / 1000.0).powi(3)).collect());
                }
            }
            (_, [loss, level @ ..]) => {
                let level = 1.0 + level.first().copied().unwrap_or(0.0);
                scale(design, &|q| level - loss * q);
            }
            _ => {}
        }
    }

    fn report(&self, context: &Context, instance: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        if instance.form == LITHIUM {
            return with_mean_slope(context, fitted);
        }
        let value = |name: &str| fitted.iter().find(|e| e.name == name).map_or((0.0, 0.0), |e| (e.value, e.se));
        let drawn = charge(context).last().copied().unwrap_or(0.0);
        let ((slope, se), (bend, _)) = (value("slope"), value("bend"));
        let mean_slope = slope + bend * drawn;
        if mean_slope > 0.0 && drawn > 0.0 {
            let volts = context.voltage.as_ref().and_then(|v| v.first().copied()).unwrap_or(CELL_V);
            let capacity = (volts / CELL_V).round().max(1.0) * CELL_SLOPE.0 / mean_slope;
            let relative = (se / mean_slope).hypot(CELL_SLOPE.1);
            fitted.insert(0, Estimate { name: "capacity".into(), unit: "Ah".into(), value: capacity, se: capacity * relative });
        }
        fitted
    }

    /// A slope that belongs to a battery larger than any rig carries is a supply that drifts.
    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        let reported = self.report(context, instance, fitted.to_vec());
        let value = |name: &str| fitted.iter().find(|e| e.name == name).map_or(0.0, |e| e.value);
        let drawn = charge(context).last().copied().unwrap_or(0.0);
        // a level and a resistance of its own make a sag of it; what is discharged must show
        let fall = (value("slope") + value("bend") * drawn) * drawn;
        let shows = context.target("voltage_v").is_some_and(|k| fall > context.targets[k].noise.rms);
        let capacity = reported.iter().find(|e| e.name == "capacity").map_or(f64::INFINITY, |e| e.value);
        // more than that is no open-circuit voltage: it would be far off on a longer run
        let bends = (value("bend") * capacity).abs() < MOST_BENT * (value("slope") + value("bend") * drawn).abs();
        let is_battery = [OTHER_SUPPLY, LITHIUM].contains(&instance.form.as_str()) || bends;
        (instance.form != OTHER_SUPPLY || shows) && is_battery && capacity < LARGEST_BATTERY
    }
}

/// Form against a declared model: the battery is another supply than that of the model's day, with a level and a resistance of its own.
const OTHER_SUPPLY: &str = "in the place of another supply";

/// Form in which the voltage falls in a straight line over the charge that a run draws.
const STRAIGHT: &str = "straight";
/// Form in which it falls along a parabola.
const CURVED: &str = "";
/// Form in which it falls along the curve of lithium-polymer cells.
const LITHIUM: &str = "lithium";

/// Most of the mean slope by which the slope of a cell's curve may have changed after half its capacity: from 0.9 V to 0.4 V per unit of charge
/// around a mean of 0.65 V (4.20 V full, 3.87 V half empty, 3.7 V at the knee).
const MOST_BENT: f64 = 0.8;

/// The largest battery that a motor rig is fed from, Ah.
const LARGEST_BATTERY: f64 = 40.0;

/// Capacities to look for, about that of the straight line.
fn capacity(context: &Context, drawn: f64) -> Shape {
    let pack = Pack::of(context).unwrap_or(Pack::FULL);
    let least = drawn / pack.begins.max(0.05);
    let usual = CELL_SLOPE.0 / (fall(context) * CELL_V).max(1e-9);
    let starts = [0.6, 1.0, 1.7].map(|k| (k * usual).clamp(1.05 * least, (0.9 * LARGEST_BATTERY).max(2.0 * least))).to_vec();
    Shape { name: "capacity", unit: "Ah", range: (least, LARGEST_BATTERY.max(3.0 * least)), starts }
}

/// What cells that empty do to a channel. A run without a voltage is taken to have that of the model, or full cells.
fn empties(context: &Context, charge: &[f64], shape: &[f64], design: &mut TargetDesign) {
    let [capacity, ref more @ ..] = *shape else { return };
    let told = || design.told.iter().find(|t| t.label == Label::Base(0)).map(|t| Pack::with(t.value));
    if design.relation == Relation::Voltage {
        let pack = Pack::of(context).or_else(told).unwrap_or(Pack::FULL);
        design.fixed.resize(charge.len(), 0.0);
        design.fixed.iter_mut().zip(charge).for_each(|(f, q)| *f -= pack.lost(*q, capacity));
        return;
    }
    let pack = Pack::of(context).unwrap_or(Pack::FULL);
    let by = more.first().copied().unwrap_or(0.0) * if design.relation == Relation::Current { -CURRENT_BY_SPEED } else { 1.0 };
    let factor: Vec<f64> = charge.iter().map(|q| 1.0 - by * pack.share_lost(*q, capacity)).collect();
    design.scale(&factor);
}

/// The estimates of a pack, with the slope at which its voltage fell over the run as a whole. How well one knows the cell's curve is in the error.
fn with_mean_slope(context: &Context, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
    let drawn = charge(context).last().copied().unwrap_or(0.0);
    let capacity = fitted.iter_mut().find(|e| e.name == "capacity");
    let (Some(capacity), Some(pack)) = (capacity.filter(|c| c.value > 0.0 && drawn > 0.0), Pack::of(context)) else {
        return fitted;
    };
    let slope = pack.lost(drawn, capacity.value) / drawn;
    let slope = Estimate { name: "slope".into(), unit: "V/Ah".into(), value: slope, se: slope * capacity.se / capacity.value };
    capacity.se = capacity.se.hypot(CELL_SLOPE.1 * capacity.value);
    fitted.push(slope);
    fitted
}

/// The supply of a run as a straight line over current and charge: voltage, V, with each ampere, ohm, with each Ah, V/Ah; nothing without a voltage.
pub(super) fn straight(context: &Context) -> Option<[f64; 3]> {
    *context.facts.supply.get_or_init(|| {
        let (volts, (current, _)) = (context.voltage.as_ref()?, context.draw()?);
        let columns = [vec![1.0; volts.len()], current.into_owned(), charge(context)];
        let solution = Normal::of_columns(&columns, volts, &vec![1.0; volts.len()]).solve()?;
        Some([0, 1, 2].map(|k| solution.coefficients[k]))
    })
}

/// Share of the voltage that goes with each Ah drawn, 1/Ah, beside what the current takes of it at once; 0 without a voltage.
fn fall(context: &Context) -> f64 {
    let (Some([_, _, slope]), Some(volts)) = (straight(context), &context.voltage) else { return 0.0 };
    let mean = volts.iter().sum::<f64>() / volts.len() as f64;
    (-slope / mean).max(0.0)
}

/// Charge drawn since the first row, Ah.
pub(crate) fn charge(context: &Context) -> Vec<f64> {
    let Some((current, _)) = context.draw() else { return vec![0.0; context.len()] };
    let mut sum = 0.0;
    let mut out = Vec::with_capacity(current.len());
    for i in 0..current.len() {
        if i > 0 {
            sum += 0.5 * (current[i] + current[i - 1]) * (context.t[i] - context.t[i - 1]) / 3600.0;
        }
        out.push(sum);
    }
    out
}
