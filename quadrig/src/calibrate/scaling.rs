//! A rig's channels calibrated from the terminal view.
//!
//! What it is: known values as the operator types them, each read once the channel has settled; then the line, and what is to be sent to store it.
//! It knows neither screen nor board: samples come in, words and commands come out.
//! What can go wrong: a value that is none, a channel that is not fitted or does not settle, a line that is no scale; nothing is sent then.
//! Units: counts; the channel's own.
//! Reference: specification `rig.md`, "The operator's side"; Beharie 2013, Eq. 5.34-5.35.

use super::channel::Channel;
use super::found::{Found, Taken};
use super::point::{Point, point};
use super::settling::{Settling, at_rest};
use firmware_rig::{Config, RigConfig};
use frame::message::Command;
use frame::rig::RigSample;
use std::time::Duration;

/// The channels by the words for them.
const WORDS: [(&str, Channel); 7] = [
    ("thrust", Channel::Thrust),
    ("loadcell", Channel::Thrust),
    ("torque", Channel::Torque),
    ("current", Channel::Current),
    ("voltage", Channel::Voltage),
    ("temperature", Channel::Temperature),
    ("temp", Channel::Temperature),
];

/// Where a calibration stands.
#[derive(Debug)]
pub(crate) struct Scaling {
    config: Option<RigConfig>,
    channel: Channel,
    taken: Vec<Taken>,
    settling: Option<(Point, Settling)>,
    found: Option<Found>,
}

impl Default for Scaling {
    fn default() -> Self {
        Self { config: None, channel: Channel::Thrust, taken: Vec::new(), settling: None, found: None }
    }
}

impl Scaling {
    /// The board's configuration, once it is known.
    pub(crate) fn knows(&mut self, config: &RigConfig) {
        self.config.get_or_insert(*config);
    }

    fn arm_m(&self) -> f64 {
        self.config.map_or(0.1, |config| f64::from(config.torque.arm_m))
    }

    /// A known value was put on, as it was typed: `200g`, `torque=100g`, `11.83V` (space is the stop key). Gives what is awaited now.
    pub(crate) fn known(&mut self, typed: &str, now: Duration) -> Result<String, String> {
        let config = self.config.ok_or("the board has not told its configuration yet; try again")?;
        let (channel, value) = match typed.trim().split_once(['=', ' ']) {
            Some((word, value)) if word.starts_with(char::is_alphabetic) => {
                let named = WORDS.iter().find(|(name, _)| *name == word.to_lowercase());
                let (_, channel) = named.ok_or_else(|| format!("{word:?}: expected thrust, torque, current, voltage or temp"))?;
                (*channel, value)
            }
            _ => (self.by_unit(typed), typed),
        };
        if !config.fitted[channel.place()] {
            return Err(format!(
                "{} is not fitted on this board; expected it in its configuration: `quadrig rig configure`",
                channel.column()
            ));
        }
        let point = point(channel, value, self.arm_m())?;
        if let Some((from, to)) = point.window {
            return Err(format!("{value:?}: the time {from} to {to} s belongs to a recording; expected the value alone"));
        }
        let dropped = if channel == self.channel { 0 } else { self.taken.len() };
        if channel != self.channel {
            (self.channel, self.taken, self.found) = (channel, Vec::new(), None);
        }
        let words = format!("{}: {} on; it settles", channel.column(), point.said);
        self.settling = Some((point, Settling::new(channel, now)));
        Ok(if dropped > 0 { format!("{words} ({dropped} points of another channel are forgotten)") } else { words })
    }

    /// The channel that a unit belongs to; without one, the channel of before.
    fn by_unit(&self, typed: &str) -> Channel {
        let unit = typed.trim().trim_start_matches(|c: char| !c.is_alphabetic() || c == 'e' || c == 'E');
        match unit.trim() {
            "g" | "kg" if self.channel == Channel::Torque => Channel::Torque,
            "g" | "kg" | "N" => Channel::Thrust,
            "N.m" | "Nm" => Channel::Torque,
            "A" | "mA" => Channel::Current,
            "V" | "mV" => Channel::Voltage,
            "C" | "degC" => Channel::Temperature,
            _ => self.channel,
        }
    }

    /// Takes a sample at `now`; gives what became of the value that was put on, once that is known.
    pub(crate) fn take(&mut self, sample: &RigSample, now: Duration) -> Option<Result<String, String>> {
        let (_, settling) = self.settling.as_mut()?;
        let done = match at_rest(sample) {
            Ok(()) => {
                settling.take(sample);
                settling.look(now)?.map_err(|why| why.to_string())
            }
            Err(why) => Err(why),
        };
        let (point, _) = self.settling.take()?;
        let place = self.channel.column();
        Some(match done {
            Ok(reading) => {
                let words = format!("{place}, {}: {:.3} counts, known to {:.3}", point.said, reading.counts, reading.sigma);
                self.taken.push(Taken { point, reading });
                Ok(format!("{words}; {} taken", self.taken.len()))
            }
            Err(why) => Err(format!("{place}, {}: {why}", point.said)),
        })
    }

    /// Forgets the values that were taken.
    pub(crate) fn forget(&mut self) {
        (self.taken, self.settling, self.found) = (Vec::new(), None, None);
    }

    /// The line through the values taken, `day` days after 1970; lines for the operator.
    pub(crate) fn fit(&mut self, day: u16) -> Result<Vec<String>, String> {
        if self.settling.is_some() {
            return Err("the last value has not settled yet; expected it to: wait a moment".to_owned());
        }
        let config = self.config.ok_or("the board has not told its configuration yet; try again")?;
        let design = config.apply(&Config::thesis_570kv()).design().adc[self.channel.place()].gain;
        let found = Found::of(self.channel, self.taken.clone(), Some(f64::from(design)), day, self.arm_m())?;
        let lines = found.table().lines().map(str::to_owned).collect();
        self.found = Some(found);
        Ok(lines)
    }

    /// What is to be sent, so that the scale that was found is in force and stored.
    pub(crate) fn store(&mut self) -> Vec<Command> {
        let (Some(config), Some(found)) = (&mut self.config, self.found.take()) else { return Vec::new() };
        config.calibrated[self.channel.place()] = Some(found.calibrated());
        let parts: Vec<_> = config.parts().collect();
        let length = parts.last().map_or(0, |part| part.length);
        let apply = Command::ConfigApply { length, crc: config.digest() };
        self.taken.clear();
        parts.into_iter().map(Command::ConfigPart).chain([apply, Command::SaveSettings]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use frame::rig::{AdcCode, AdcVerdict, RigState};
    use frame::units::Ticks;

    /// A rig at rest whose every analogue channel reads so many counts.
    fn sample(ms: u64, counts: f64, state: RigState) -> RigSample {
        let sum = (counts * 1000.0).round() as u32;
        let code = AdcCode { sum, count: 1000, rms_q8: 0, verdict: AdcVerdict::Nominal };
        RigSample { at: Ticks::from_ms(ms), state, adc: [code; 5], ..RigSample::default() }
    }

    fn scaling() -> Scaling {
        let mut scaling = Scaling::default();
        scaling.knows(&RigConfig::of(&Config::thesis_570kv()));
        scaling
    }

    /// Two and a half seconds of samples; what became of the value.
    fn settles(scaling: &mut Scaling, from_ms: u64, counts: f64) -> Result<String, String> {
        let each = (0..25u64).map(|k| from_ms + 100 * k);
        let mut said = each.filter_map(|ms| scaling.take(&sample(ms, counts, RigState::Disarmed), Duration::from_millis(ms)));
        said.next().expect("it is settled")
    }

    #[test]
    fn typed_values_become_a_scale_that_is_sent_whole_and_stored() {
        let mut scaling = scaling();
        for (n, (typed, counts)) in [("0 g", 1500.0), ("100 g", 1768.0), ("200", 2036.0)].into_iter().enumerate() {
            let ms = 10_000 * n as u64;
            assert!(scaling.known(typed, Duration::from_millis(ms)).is_ok());
            assert!(settles(&mut scaling, ms, counts).is_ok_and(|said| said.contains(&format!("{} taken", n + 1))));
        }
        let lines = scaling.fit(20_781).expect("a scale");
        assert!(lines.iter().any(|line| line.contains("of 3 points")), "{lines:?}");
        let commands = scaling.store();
        let mut form = Vec::new();
        for command in &commands {
            if let Command::ConfigPart(part) = command {
                form.extend_from_slice(&part.bytes);
                form.truncate(usize::from(part.length));
            }
        }
        let config = RigConfig::from_form(&form).expect("a configuration");
        let thrust = config.calibrated[0].expect("a scale");
        assert!((f64::from(thrust.scale.gain) * 268.0 + 0.980_665).abs() < 1e-4, "{thrust:?}");
        assert_eq!((thrust.points, thrust.day), (3, 20_781));
        let [.., Command::ConfigApply { crc, .. }, Command::SaveSettings] = commands[..] else { panic!("{commands:?}") };
        assert_eq!(crc, config.digest());
        assert!(scaling.store().is_empty(), "once");
    }

    #[test]
    fn a_unit_or_a_word_names_the_channel() {
        for (typed, channel) in [
            ("5A", Channel::Current),
            ("250 mA", Channel::Current),
            ("11.83 V", Channel::Voltage),
            ("0.02 N.m", Channel::Torque),
            ("torque=100g", Channel::Torque),
            ("temp=21.5", Channel::Temperature),
            ("-1.5e-1 N", Channel::Thrust),
            ("200", Channel::Thrust),
        ] {
            let mut scaling = scaling();
            scaling.known(typed, Duration::ZERO).expect(typed);
            assert_eq!(scaling.channel, channel, "{typed}");
        }
        for nonsense in ["", "lots", "weight=200g", "5 furlongs", "200 g@1..2"] {
            assert!(scaling().known(nonsense, Duration::ZERO).is_err(), "{nonsense}");
        }
    }

    #[test]
    fn nothing_is_taken_of_a_rig_that_is_armed_nor_stored_without_a_line() {
        let mut scaling = scaling();
        assert!(Scaling::default().known("0 g", Duration::ZERO).is_err(), "before its configuration is known");
        scaling.known("0 g", Duration::ZERO).expect("a value");
        let said = scaling.take(&sample(0, 1500.0, RigState::Armed), Duration::ZERO).expect("news");
        assert!(said.is_err_and(|why| why.contains("disarmed")));
        assert!(scaling.fit(1).is_err_and(|why| why.contains("two different values")));
        assert!(scaling.store().is_empty());
        scaling.known("0 g", Duration::ZERO).expect("a value");
        assert!(scaling.fit(1).is_err_and(|why| why.contains("settled")));
    }
}
