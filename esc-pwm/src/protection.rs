//! The limits that bring the throttle to minimum.
//!
//! What it is: readings in, tripped faults out, with how long each limit must be exceeded before it trips.
//! What can go wrong: a reading that is missing trips nothing by itself; missing conversions are a fault of their own.
//! Units: SI and rev/min; milliseconds.
//! Reference: specification `rig.md`, "Protection"; beam yield margin Beharie 2013, Eq. 5.53-5.56.

use crate::fault::{Fault, FaultSet};
use crate::state::State;
use crate::units::{Ampere, Celsius, Newton, NewtonMetre, RevPerMin, Volt};

/// Lowest and highest value of a channel, and for how long it may be beyond one of them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Bounds<T> {
    /// Lowest; `None` for no limit.
    pub low: Option<T>,
    /// Highest; `None` for no limit.
    pub high: Option<T>,
    /// How long, milliseconds.
    pub ms: u16,
}

impl<T: PartialOrd + Copy> Bounds<T> {
    /// No limit either way.
    pub const NONE: Self = Self { low: None, high: None, ms: 100 };

    /// Whether a reading is above the highest value; one that is missing is not.
    fn is_over(&self, reading: Option<T>) -> bool {
        reading.zip(self.high).is_some_and(|(reading, high)| reading > high)
    }

    /// Whether a reading is below the lowest value; one that is missing is not.
    fn is_under(&self, reading: Option<T>) -> bool {
        reading.zip(self.low).is_some_and(|(reading, low)| reading < low)
    }
}

/// Limits and their times. The time from cause to minimum throttle is the limit's time plus one control tick and one
/// ESC frame (20 ms).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limits {
    /// Rotor speed: the highest always, the lowest while the throttle is open.
    pub speed: Bounds<RevPerMin>,
    /// Load on the cell, untared, thrust up, while pulses above minimum are given.
    pub thrust: Bounds<Newton>,
    /// Torque, untared, while pulses above minimum are given.
    pub torque: Bounds<NewtonMetre>,
    /// Current: the highest always, the lowest while the throttle is open.
    pub current: Bounds<Ampere>,
    /// Supply, while armed or running.
    pub voltage: Bounds<Volt>,
    /// Temperature, while armed or running.
    pub temperature: Bounds<Celsius>,
    /// Highest current while the ESC is meant to stand: above it, maximum pulses are not for calibration any more.
    pub idle_current: Ampere,
    /// Channels that may disagree with the others before it counts as a fault.
    pub disagreeing: u8,
    /// Longest silence of the host while armed or running, milliseconds.
    pub link_ms: u32,
    /// Longest time between two control ticks, milliseconds.
    pub stall_ms: u32,
    /// How long current must be above idle during the range calibration, milliseconds: longer than charging the ESC's capacitors takes
    /// (2200 uF through 0.2 ohm: five time constants are 2.2 ms), and no longer.
    pub idle_ms: u32,
    /// How long conversions must be missing or stuck, milliseconds.
    pub analogue_ms: u32,
    /// How long sensors must disagree, milliseconds.
    pub sensor_ms: u32,
    /// How long a speed channel must be known as lost, milliseconds.
    pub lost_ms: u32,
}

/// What the limits look at, one control tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Readings {
    /// Speed by which overspeed is judged: second-fastest plausible channel, the fastest where one or two are fitted.
    pub speed: Option<RevPerMin>,
    /// The rotor moves, by any speed channel, while maximum is held towards an ESC that must be off.
    pub stirs: bool,
    /// Current over the last tick.
    pub current: Option<Ampere>,
    /// Supply over the last tick.
    pub voltage: Option<Volt>,
    /// Load on the cell, motor's weight included.
    pub load: Option<Newton>,
    /// Torque at the motor.
    pub torque: Option<NewtonMetre>,
    /// Temperature.
    pub temperature: Option<Celsius>,
    /// The throttle is open: pulses above minimum are given, and have been for as long as the rotor takes to start.
    pub driven: bool,
    /// The strain code sits at an end of its range.
    pub load_saturated: bool,
    /// Channels that disagree with the others at this moment.
    pub disagreeing: u8,
    /// Speed channels that are silent while the others see the rotor turn.
    pub lost: u8,
    /// No conversions came since the last tick, or a channel that must not is at an end of its range.
    pub adc_missing: bool,
    /// Damaged frames of the host since the last tick.
    pub damaged: u8,
    /// Replayed frames of the host since the last tick.
    pub replayed: u8,
    /// The voltage detector sees the board's own supply too low.
    pub brown_out: bool,
    /// Milliseconds since the host was heard.
    pub silence_ms: u32,
    /// Milliseconds since the last control tick.
    pub tick_ms: u32,
}

/// Counts how long each limit has been exceeded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Protection {
    speed_ms: u32,
    slow_ms: u32,
    current_ms: u32,
    faint_ms: u32,
    idle_ms: u32,
    voltage_ms: u32,
    high_voltage_ms: u32,
    load_ms: u32,
    torque_ms: u32,
    temperature_ms: u32,
    disagree_ms: u32,
    adc_ms: u32,
    lost_ms: u32,
    damage: u32,
}

/// What one damaged frame adds to the account of damage, which sinks by one a millisecond: frames no more than 250 ms apart
/// fill it with the third.
const DAMAGE_OF_A_FRAME: u32 = 500;
/// Account of damage at which the link counts as corrupt.
const DAMAGE_LIMIT: u32 = 1000;

/// Advances a timer while `exceeded`; says whether it has reached `limit`.
fn lasted(timer: &mut u32, exceeded: bool, tick_ms: u32, limit: u32) -> bool {
    *timer = if exceeded { timer.saturating_add(tick_ms.max(1)) } else { 0 };
    exceeded && *timer >= limit
}

impl Protection {
    /// One control tick: which limits are tripped now. Latching them is the caller's state machine.
    pub fn check(&mut self, state: State, readings: &Readings, limits: &Limits) -> FaultSet {
        let tick = readings.tick_ms;
        let live = matches!(state, State::Running | State::CalibrateHoldMax);
        let linked = live || matches!(state, State::Armed | State::CalibrateHoldMin);
        let powered = matches!(state, State::Running | State::Armed);
        let holds_max = state == State::CalibrateHoldMax;

        let driven = state == State::Running && readings.driven;

        let Limits { speed, thrust, torque, current, voltage, temperature, .. } = limits;
        let fast = lasted(&mut self.speed_ms, speed.is_over(readings.speed), tick, speed.ms.into());
        let slow = lasted(&mut self.slow_ms, driven && speed.is_under(readings.speed), tick, speed.ms.into());
        let much = lasted(&mut self.current_ms, current.is_over(readings.current), tick, current.ms.into());
        let faint = lasted(&mut self.faint_ms, driven && current.is_under(readings.current), tick, current.ms.into());
        let not_idle = holds_max && readings.current.is_some_and(|v| v > limits.idle_current);
        let idle = lasted(&mut self.idle_ms, not_idle, tick, limits.idle_ms);
        let under = lasted(&mut self.voltage_ms, powered && voltage.is_under(readings.voltage), tick, voltage.ms.into());
        let over = lasted(&mut self.high_voltage_ms, powered && voltage.is_over(readings.voltage), tick, voltage.ms.into());
        let heavy = readings.load_saturated || thrust.is_over(readings.load) || thrust.is_under(readings.load);
        let load = lasted(&mut self.load_ms, live && heavy, tick, thrust.ms.into());
        let twisted = torque.is_over(readings.torque) || torque.is_under(readings.torque);
        let twist = lasted(&mut self.torque_ms, live && twisted, tick, torque.ms.into());
        let warm = temperature.is_over(readings.temperature) || temperature.is_under(readings.temperature);
        let heat = lasted(&mut self.temperature_ms, powered && warm, tick, temperature.ms.into());
        let disagree = lasted(&mut self.disagree_ms, live && readings.disagreeing > limits.disagreeing, tick, limits.sensor_ms);
        let adc = lasted(&mut self.adc_ms, live && readings.adc_missing, tick, limits.analogue_ms);
        let lost = lasted(&mut self.lost_ms, live && readings.lost > 0, tick, limits.lost_ms);
        self.damage = self.damage.saturating_sub(tick).saturating_add(DAMAGE_OF_A_FRAME * u32::from(readings.damaged));

        [
            (Fault::Overspeed, fast),
            (Fault::OverCurrent, much || idle),
            (Fault::UnderVoltage, under),
            (Fault::BelowLimit, slow || faint),
            (Fault::OverVoltage, over),
            (Fault::TorqueLimit, twist),
            (Fault::TemperatureLimit, heat),
            (Fault::LoadCellOverload, load),
            (Fault::SensorDisagreement, disagree),
            (Fault::AdcLost, adc),
            (Fault::SensorLost, lost),
            (Fault::LinkCorrupt, linked && self.damage >= DAMAGE_LIMIT),
            (Fault::CommandReplayed, linked && readings.replayed > 0),
            (Fault::BrownOut, readings.brown_out),
            (Fault::RotorTurned, holds_max && readings.stirs),
            (Fault::LinkLost, linked && readings.silence_ms > limits.link_ms),
            (Fault::ControlStalled, readings.tick_ms > limits.stall_ms),
        ]
        .into_iter()
        .fold(FaultSet::NONE, |set, (fault, tripped)| if tripped { set.with(fault) } else { set })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        speed: Bounds { low: Some(RevPerMin(500.0)), high: Some(RevPerMin(10_000.0)), ms: 5 },
        thrust: Bounds { low: Some(Newton(-30.0)), high: Some(Newton(30.0)), ms: 50 },
        torque: Bounds { low: Some(NewtonMetre(-0.1)), high: Some(NewtonMetre(0.5)), ms: 40 },
        current: Bounds { low: Some(Ampere(0.1)), high: Some(Ampere(30.0)), ms: 50 },
        voltage: Bounds { low: Some(Volt(9.0)), high: Some(Volt(17.0)), ms: 50 },
        temperature: Bounds { low: None, high: Some(Celsius(80.0)), ms: 1000 },
        idle_current: Ampere(1.0),
        disagreeing: 1,
        link_ms: 1000,
        stall_ms: 5,
        idle_ms: 5,
        analogue_ms: 50,
        sensor_ms: 500,
        lost_ms: 50,
    };

    fn good() -> Readings {
        Readings {
            speed: Some(RevPerMin(4000.0)),
            current: Some(Ampere(5.0)),
            voltage: Some(Volt(11.5)),
            load: Some(Newton(3.0)),
            torque: Some(NewtonMetre(0.05)),
            temperature: Some(Celsius(25.0)),
            driven: true,
            tick_ms: 1,
            ..Readings::default()
        }
    }

    /// Ticks until `fault` trips, at most two seconds.
    fn trips_after(state: State, readings: Readings, fault: Fault) -> Option<u32> {
        let mut protection = Protection::default();
        (1..=2000).find(|_| protection.check(state, &readings, &LIMITS).contains(fault))
    }

    #[test]
    fn good_readings_trip_nothing() {
        let mut protection = Protection::default();
        for _ in 0..5000 {
            assert!(protection.check(State::Running, &good(), &LIMITS).is_empty());
        }
    }

    #[test]
    fn each_limit_trips_within_its_time() {
        use State::{Armed, CalibrateHoldMax, Disarmed, Running};
        let over = Readings { current: Some(Ampere(31.0)), ..good() };
        assert_eq!(trips_after(Running, over, Fault::OverCurrent), Some(50));
        assert_eq!(trips_after(CalibrateHoldMax, good(), Fault::OverCurrent), Some(5), "5 A is more than idle");
        assert_eq!(trips_after(CalibrateHoldMax, Readings { stirs: true, ..good() }, Fault::RotorTurned), Some(1));
        assert_eq!(trips_after(Running, Readings { stirs: true, ..good() }, Fault::RotorTurned), None, "it turns, as it should");
        assert_eq!(trips_after(Running, Readings { speed: Some(RevPerMin(10_001.0)), ..good() }, Fault::Overspeed), Some(5));
        let low = Readings { voltage: Some(Volt(8.9)), ..good() };
        assert_eq!(trips_after(Running, low, Fault::UnderVoltage), Some(50));
        assert_eq!(trips_after(Disarmed, low, Fault::UnderVoltage), None, "an unpowered ESC is no fault before arming");
        let high = Readings { voltage: Some(Volt(17.1)), ..good() };
        assert_eq!(trips_after(Armed, high, Fault::OverVoltage), Some(50));
        assert_eq!(trips_after(Running, Readings { torque: Some(NewtonMetre(0.51)), ..good() }, Fault::TorqueLimit), Some(40));
        assert_eq!(trips_after(Running, Readings { torque: Some(NewtonMetre(-0.11)), ..good() }, Fault::TorqueLimit), Some(40));
        let hot = Readings { temperature: Some(Celsius(80.5)), ..good() };
        assert_eq!(trips_after(Running, hot, Fault::TemperatureLimit), Some(1000));
        assert_eq!(trips_after(Disarmed, hot, Fault::TemperatureLimit), None);
        let slow = Readings { speed: Some(RevPerMin(499.0)), ..good() };
        assert_eq!(trips_after(Running, slow, Fault::BelowLimit), Some(5));
        assert_eq!(trips_after(Running, Readings { driven: false, ..slow }, Fault::BelowLimit), None, "it may stand");
        assert_eq!(trips_after(Armed, slow, Fault::BelowLimit), None);
        assert_eq!(trips_after(Running, Readings { current: Some(Ampere(0.05)), ..good() }, Fault::BelowLimit), Some(50));
        assert_eq!(trips_after(Running, Readings { load: Some(Newton(-31.0)), ..good() }, Fault::LoadCellOverload), Some(50));
        assert_eq!(trips_after(Running, Readings { load_saturated: true, ..good() }, Fault::LoadCellOverload), Some(50));
        assert_eq!(trips_after(Running, Readings { disagreeing: 2, ..good() }, Fault::SensorDisagreement), Some(500));
        assert_eq!(trips_after(Running, Readings { disagreeing: 1, ..good() }, Fault::SensorDisagreement), None);
        assert_eq!(trips_after(Running, Readings { adc_missing: true, ..good() }, Fault::AdcLost), Some(50));
        assert_eq!(trips_after(Running, Readings { lost: 1, ..good() }, Fault::SensorLost), Some(50));
        assert_eq!(trips_after(Armed, Readings { lost: 1, ..good() }, Fault::SensorLost), None, "it coasts");
        assert_eq!(trips_after(Running, Readings { replayed: 1, ..good() }, Fault::CommandReplayed), Some(1));
        assert_eq!(trips_after(Disarmed, Readings { replayed: 1, ..good() }, Fault::CommandReplayed), None, "only refused");
        assert_eq!(trips_after(Disarmed, Readings { brown_out: true, ..good() }, Fault::BrownOut), Some(1));
        let silent = Readings { silence_ms: 1001, ..good() };
        assert_eq!(trips_after(Armed, silent, Fault::LinkLost), Some(1));
        assert_eq!(trips_after(Disarmed, silent, Fault::LinkLost), None);
        assert_eq!(trips_after(Disarmed, Readings { tick_ms: 6, ..good() }, Fault::ControlStalled), Some(1));
    }

    /// A limit may be reached; only what lies beyond it trips, in whatever direction it is.
    #[test]
    fn a_reading_at_its_limit_is_within_it() {
        use State::{Armed, CalibrateHoldMax, Running};
        let of = |change: fn(&mut Readings, f32), value: f32| {
            let mut readings = good();
            change(&mut readings, value);
            readings
        };
        type Row = (State, Fault, fn(&mut Readings, f32), f32, f32);
        let rows: [Row; 13] = [
            (Running, Fault::Overspeed, |r, v| r.speed = Some(RevPerMin(v)), 10_000.0, 10_001.0),
            (Running, Fault::BelowLimit, |r, v| r.speed = Some(RevPerMin(v)), 500.0, 499.0),
            (Running, Fault::OverCurrent, |r, v| r.current = Some(Ampere(v)), 30.0, 30.1),
            (Running, Fault::BelowLimit, |r, v| r.current = Some(Ampere(v)), 0.1, 0.09),
            (CalibrateHoldMax, Fault::OverCurrent, |r, v| r.current = Some(Ampere(v)), 1.0, 1.1),
            (Armed, Fault::UnderVoltage, |r, v| r.voltage = Some(Volt(v)), 9.0, 8.9),
            (Armed, Fault::OverVoltage, |r, v| r.voltage = Some(Volt(v)), 17.0, 17.1),
            (Running, Fault::LoadCellOverload, |r, v| r.load = Some(Newton(v)), 30.0, 30.1),
            (Running, Fault::LoadCellOverload, |r, v| r.load = Some(Newton(v)), -30.0, -30.1),
            (Running, Fault::TorqueLimit, |r, v| r.torque = Some(NewtonMetre(v)), 0.5, 0.51),
            (Running, Fault::TemperatureLimit, |r, v| r.temperature = Some(Celsius(v)), 80.0, 80.1),
            (Armed, Fault::LinkLost, |r, v| r.silence_ms = v as u32, 1000.0, 1001.0),
            (Running, Fault::ControlStalled, |r, v| r.tick_ms = v as u32, 5.0, 6.0),
        ];
        for (state, fault, change, at, beyond) in rows {
            assert_eq!(trips_after(state, of(change, at), fault), None, "{fault:?} at {at}");
            assert!(trips_after(state, of(change, beyond), fault).is_some(), "{fault:?} at {beyond}");
        }
    }

    /// What the rig does in a state decides which limits are looked at: loads where pulses above minimum are given, the supply where the ESC
    /// is meant to have one, the host wherever the machine may go on by itself.
    #[test]
    fn each_limit_is_looked_at_in_its_states_and_in_no_others() {
        use State::{Armed, CalibrateHoldMax, CalibrateHoldMin, Running};
        let live: &[State] = &[Running, CalibrateHoldMax];
        let powered: &[State] = &[Running, Armed];
        let linked: &[State] = &[Running, CalibrateHoldMax, Armed, CalibrateHoldMin];
        let always: &[State] = &crate::arming::STATES;
        let at_rest = || Readings { current: Some(Ampere(0.5)), ..good() };
        for (fault, readings, states) in [
            (Fault::Overspeed, Readings { speed: Some(RevPerMin(11_000.0)), ..at_rest() }, always),
            (Fault::OverCurrent, Readings { current: Some(Ampere(31.0)), ..at_rest() }, always),
            (Fault::OverCurrent, Readings { current: Some(Ampere(1.5)), ..at_rest() }, &[CalibrateHoldMax]),
            (Fault::BelowLimit, Readings { speed: Some(RevPerMin(100.0)), ..at_rest() }, &[Running]),
            (Fault::BelowLimit, Readings { current: Some(Ampere(0.05)), ..at_rest() }, &[Running]),
            (Fault::UnderVoltage, Readings { voltage: Some(Volt(8.0)), ..at_rest() }, powered),
            (Fault::OverVoltage, Readings { voltage: Some(Volt(18.0)), ..at_rest() }, powered),
            (Fault::TemperatureLimit, Readings { temperature: Some(Celsius(90.0)), ..at_rest() }, powered),
            (Fault::LoadCellOverload, Readings { load: Some(Newton(31.0)), ..at_rest() }, live),
            (Fault::LoadCellOverload, Readings { load_saturated: true, ..at_rest() }, live),
            (Fault::TorqueLimit, Readings { torque: Some(NewtonMetre(0.6)), ..at_rest() }, live),
            (Fault::SensorDisagreement, Readings { disagreeing: 2, ..at_rest() }, live),
            (Fault::AdcLost, Readings { adc_missing: true, ..at_rest() }, live),
            (Fault::SensorLost, Readings { lost: 1, ..at_rest() }, live),
            (Fault::LinkLost, Readings { silence_ms: 1001, ..at_rest() }, linked),
            (Fault::LinkCorrupt, Readings { damaged: 1, ..at_rest() }, linked),
            (Fault::CommandReplayed, Readings { replayed: 1, ..at_rest() }, linked),
            (Fault::RotorTurned, Readings { stirs: true, ..at_rest() }, &[CalibrateHoldMax]),
            (Fault::BrownOut, Readings { brown_out: true, ..at_rest() }, always),
            (Fault::ControlStalled, Readings { tick_ms: 6, ..at_rest() }, always),
        ] {
            for state in crate::arming::STATES {
                assert_eq!(trips_after(state, readings, fault).is_some(), states.contains(&state), "{fault:?} in {state:?}");
            }
        }
    }

    /// A late tick counts for as long as it took, one within the same millisecond for one.
    #[test]
    fn times_are_those_of_the_clock_and_not_of_the_ticks() {
        let over = |tick_ms| Readings { current: Some(Ampere(31.0)), tick_ms, ..good() };
        assert_eq!(trips_after(State::Running, over(5), Fault::OverCurrent), Some(10));
        assert_eq!(trips_after(State::Running, over(0), Fault::OverCurrent), Some(50));
    }

    /// A channel that is not fitted has no reading, and one without bounds no limit.
    #[test]
    fn what_is_missing_trips_nothing() {
        let (mut blind, mut free) = (Protection::default(), Protection::default());
        let nothing = Readings { driven: true, tick_ms: 1, ..Readings::default() };
        let no_limits = Limits {
            speed: Bounds::NONE,
            thrust: Bounds::NONE,
            torque: Bounds::NONE,
            current: Bounds::NONE,
            voltage: Bounds::NONE,
            temperature: Bounds::NONE,
            ..LIMITS
        };
        for _ in 0..2000 {
            assert!(blind.check(State::Running, &nothing, &LIMITS).is_empty());
            assert!(free.check(State::Running, &good(), &no_limits).is_empty());
        }
    }

    #[test]
    fn the_third_damaged_frame_in_half_a_second_trips_and_rare_ones_do_not() {
        let trips = |apart: u32| {
            let mut protection = Protection::default();
            (0..60_000).find(|ms| {
                let damaged = u8::from(ms % apart == 0);
                let readings = Readings { damaged, ..good() };
                protection.check(State::Running, &readings, &LIMITS).contains(Fault::LinkCorrupt)
            })
        };
        assert_eq!(trips(1), Some(2));
        assert_eq!(trips(250), Some(500));
        assert_eq!(trips(500), None, "two a second are bad luck");
    }

    #[test]
    fn a_short_peak_is_forgiven() {
        let mut protection = Protection::default();
        let peak = Readings { current: Some(Ampere(60.0)), ..good() };
        for i in 0..1000 {
            let readings = if i % 50 == 49 { good() } else { peak };
            assert!(protection.check(State::Running, &readings, &LIMITS).is_empty());
        }
    }
}
