//! The bench in time.
//!
//! What it is: one step of 0.1 ms, ten of them at once, and what is settled before each millisecond.
//! What can go wrong: a powerplant that gives a NaN or a negative speed is taken as a resting rotor.
//! Units: ns and steps since power-up; V at the pins.
//! Reference: house rule 7; `docs/speed.md`, for what is computed part by part.

use super::imbalance::{SPEEDS, turn_cosine};
use super::{Bench, Millisecond, STEP_NS, STEP_S, Truth};
use crate::effect::{Levers, open};
use crate::plant::bridge::Load;
use crate::plant::powerplant::STEPS_PER_MS;
use crate::plant::{Beam, EscState};
use crate::sensor::Edge;
use core::f64::consts::TAU;
use frame::rig::CAPTURE_CHANNELS;

/// Ticks of 84 MHz in a step.
const STEP_TICKS: u64 = 8_400;

impl Bench {
    /// One millisecond of a native run. Call it at whole milliseconds only, and not together with [`Bench::advance_to`].
    pub fn millisecond(&mut self, out: &mut Millisecond) {
        for edges in out.edges.iter_mut().chain([&mut out.back_emf]) {
            edges.clear();
        }
        self.each_millisecond();
        // The board makes 61.8 conversions of each channel in a millisecond, a run here 8.5 for the sake of its speed: the noise of
        // its means is 2.7 times the board's (docs/rig.md, "Analogue channels").
        let count = 9 - ((self.steps / STEPS_PER_MS as u64) & 1) as u16;
        if self.rigid && !self.recorded {
            self.block(out, count);
        } else {
            self.converter.draw_ahead(count);
            for _ in 0..STEPS_PER_MS {
                self.step();
            }
            while let Some(edge) = self.edges.pop_front() {
                if edge.rising {
                    out.edges[usize::from(edge.channel)].push(edge.at_ticks as u32);
                }
            }
            out.back_emf.extend(self.turns.drain(..).filter(|e| e.rising).map(|e| e.at_ticks as u32));
        }
        out.esc.clear();
        out.esc.extend(std::iter::from_fn(|| self.telemetry.word(self.steps * STEP_NS)));
        let pins_v = self.pins_v();
        if self.levers.spike_v[0] != 0.0 {
            self.strain_v.iter_mut().for_each(|v| *v += self.levers.spike_v[0]);
        }
        self.converter.blocks(count, &self.strain_v, &pins_v, &mut out.adc);
        out.codes.clear();
        if let Some(channel) = out.watched {
            out.codes.extend(self.converter.codes(channel, count, &self.strain_v, &pins_v));
        }
    }

    pub(super) fn each_millisecond(&mut self) {
        self.esc.advance_to(self.horizon_ns());
        self.esc.feel(self.truth.plant.voltage_v, self.truth.plant.current_a, 1.0e-3);
        self.output_us = self.esc.output_us();
        let run_s = match self.run_start_steps {
            Some(start) => (self.steps - start) as f64 * STEP_S,
            None => -1.0,
        };
        let open = open(&self.effects, run_s);
        if open != self.open {
            self.open = open;
            self.refit();
        }
        if !self.effects.is_empty() {
            self.levers = Levers { seed: self.seed, ..Levers::default() };
        }
        self.levers.plant.run_s = run_s;
        if run_s >= 0.0 {
            for (i, effect) in self.effects.iter().enumerate() {
                if open & (1 << i) != 0 {
                    effect.act(run_s, &mut self.levers);
                }
            }
        }
        self.tachometers.couple(!self.levers.encoder_off);
        let unbalance = Beam { unbalance_kgm: self.beam.unbalance_kgm + self.levers.unbalance_kgm, ..self.beam };
        self.shake_n = unbalance.shaking_n(TAU, 1.0);
        // the logger's clock may stand still again; its tape then runs out
        self.recorded |= self.levers.late_s > 0.0;
        self.plant.adjust(&self.levers.plant);
        self.truth.run_s = run_s;
        let turned = (self.metered_rev, self.angle_rev);
        self.emf = self.plant.back_emf();
        self.meter.pass(turned, self.emf, self.steps as f64 * STEP_S, 1.0e-3);
        self.metered_rev = self.angle_rev;
        self.truth.back_emf_rpm = self.meter.rpm();
        if self.listens.esc {
            let awake = self.esc.powered() && self.esc.state() != EscState::SelfTest;
            self.telemetry.millisecond(self.horizon_ns(), awake, &self.truth.plant, self.esc.temperature_c());
        }
    }

    /// Ten steps at once, part by part instead of step by step: the same numbers, for what comes later in a step never acts on what
    /// comes earlier in the next. Only for stiff joints and no logger.
    fn block(&mut self, out: &mut Millisecond, count: u16) {
        let (plant, whirl, converter) = (&mut self.turned, &mut self.whirl, &mut self.converter);
        self.plant.advance_block(STEP_S, self.output_us, plant, &mut || converter.draw_ahead(count));
        if !SPEEDS.contains(&plant.last.rpm) {
            plant.last.rpm = 0.0;
        }
        if !self.esc.powered() {
            (plant.last.voltage_v, plant.last.current_a) = (0.0, 0.0);
        }

        whirl.turn(self.angle_rev, &plant.rpm);
        let start_ticks = self.steps * STEP_TICKS;
        let ([turned @ .., _, _], [rev_s @ .., _, _]) = (&whirl.turned, &whirl.rev_s);
        self.angle_rev = turned[STEPS_PER_MS];
        self.tachometers.block(turned, rev_s, |channel, rising, step, fraction| {
            if rising {
                let ticks = start_ticks + step as u64 * STEP_TICKS + (fraction * STEP_TICKS as f64) as u64;
                out.edges[usize::from(channel)].push(ticks as u32);
            }
        });

        if self.listens.back_emf {
            let emf = self.emf;
            for (step, pair) in whirl.turned[..=STEPS_PER_MS].windows(2).enumerate() {
                self.comparator.turn((pair[0], pair[1]), emf, |rising, share| {
                    if rising {
                        out.back_emf.push((start_ticks + step as u64 * STEP_TICKS + (share * STEP_TICKS as f64) as u64) as u32);
                    }
                });
            }
        }

        whirl.shake(self.shake_n, self.heavy_spot_rev);
        let load = Load {
            thrust_n: &plant.thrust_n,
            shaking_n: &whirl.force_n,
            torque_nm: &plant.torque_nm,
            temp_c: &plant.temp_c,
            zero_n: (self.levers.strain_zero_n + self.by_hand.0, self.levers.torque_to_lift),
            gain: self.levers.strain_gain,
        };
        let beam_n = self.bridge.block(&mut self.mode, &load, &mut self.strain_v);
        self.torque_v = self.front.torque_v(plant.torque_nm[STEPS_PER_MS - 1] + self.by_hand.1);
        self.truth = Truth { pulse_us: self.output_us, plant: plant.last, beam_n, ..self.truth };
        self.steps += STEPS_PER_MS as u64;
    }

    /// One step; [`Bench::each_millisecond`] comes before the first of each millisecond.
    pub(super) fn step(&mut self) {
        let place = (self.steps % STEPS_PER_MS as u64) as usize;
        let mut state = self.plant.advance(STEP_S, self.output_us);
        if !SPEEDS.contains(&state.rpm) {
            state.rpm = 0.0;
        }
        if !self.esc.powered() {
            (state.voltage_v, state.current_a) = (0.0, 0.0);
        }

        let speed_rev_s = state.rpm / 60.0;
        let from = self.angle_rev;
        let to = from + speed_rev_s * STEP_S;
        let (start_ns, start_ticks) = (self.steps * STEP_NS, self.steps * STEP_TICKS);
        let edges = &mut self.edges;
        let before = edges.len();
        self.tachometers.step(from, to, speed_rev_s, |channel, rising, fraction| {
            edges.push_back(Edge {
                channel,
                rising,
                at_ns: start_ns + (fraction * STEP_NS as f64) as u64,
                at_ticks: start_ticks + (fraction * STEP_TICKS as f64) as u64,
            });
        });
        if edges.len() > before + 1 {
            edges.make_contiguous()[before..].sort_by_key(|e| (e.at_ns, e.channel));
        }
        self.angle_rev = to;
        if self.listens.back_emf {
            let turns = &mut self.turns;
            self.comparator.turn((from, to), self.emf, |rising, share| {
                turns.push_back(Edge {
                    channel: CAPTURE_CHANNELS as u8,
                    rising,
                    at_ns: start_ns + (share * STEP_NS as f64) as u64,
                    at_ticks: start_ticks + (share * STEP_TICKS as f64) as u64,
                });
            });
        }

        let (mut lift_n, mut torque_nm) = (state.thrust_n, state.torque_nm);
        if !self.rigid {
            self.joints.shake(&self.mount, to - from);
            (lift_n, torque_nm) = self.joints.tilted(&self.mount, lift_n, torque_nm, self.beam.length_m);
        }
        let force = lift_n + self.shake_n * speed_rev_s * speed_rev_s * turn_cosine(to + self.heavy_spot_rev);
        let beam_n = self.mode.step(force);
        let zero_n = self.levers.strain_zero_n + self.by_hand.0 + self.levers.torque_to_lift * torque_nm;
        let mut strain_v = self.bridge.step(beam_n, zero_n, self.levers.strain_gain, state.temp_c);
        if !self.rigid {
            torque_nm = self.joints.arm(&self.mount, torque_nm);
        }
        let mut torque_v = self.front.torque_v(torque_nm + self.by_hand.1);
        if self.recorded {
            [strain_v, torque_v] = self.logger.pass([strain_v, torque_v], self.levers.late_s, STEP_S);
        }
        self.torque_v = torque_v;
        self.strain_v[place] = strain_v;
        self.truth = Truth { pulse_us: self.output_us, plant: state, beam_n, ..self.truth };
        self.steps += 1;
    }
}
