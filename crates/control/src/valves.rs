//! Valves that realise a fraction of opening: one 5/3 valve, two 3/2 valves, valves that are open or shut.

mod reach;

use crate::gains::{GainValues, law};
use crate::model::Model;
use crate::number::memory;
use crate::observer::Observer;
use crate::spool::Spool;
use crate::thresholds::{STIFFNESS_RATE, STIFFNESS_WEIGHT};
use crate::types::{Armature, Arrangement, MOST_VALVES, Plant, samples};
use physics::{above, at_least};
use reach::Reach;

/// Commands of the valves of a drive, in their order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Commands {
    values: [f64; MOST_VALVES],
    count: usize,
}

impl Commands {
    fn of<const N: usize>(each: [f64; N]) -> Self {
        let mut values = [0.0; MOST_VALVES];
        values[..N].copy_from_slice(&each);
        Commands { values, count: N }
    }

    /// Their values.
    pub fn values(&self) -> &[f64] {
        &self.values[..self.count]
    }

    /// The same data after an operation on each.
    pub fn map(mut self, f: impl FnMut(f64) -> f64) -> Self {
        self.values = self.values.map(f);
        self
    }
}

law! {
    /// Two 3/2 valves, one at each chamber. The command of the law for one 5/3 valve determines the force. In
    /// addition, both forces of the chambers grow at one rate, so that the drive has the stiffness
    ///
    ///   K = k (p_a A_a^2/V_a + p_b A_b^2/V_b),   K' = rate (stiffness - K)
    ///
    /// as far as the valves can in addition to the force.
    pub struct Pair {
        stiffness: "N/m", above(0.0), "of the shut-in gas, where pressures allow it", rule "that of both chambers at the mean of supply and ambient pressure, mid stroke";
        rate: "1/s", at_least(0.0), "at which the stiffness follows", rule "a fifth of 0.22/lag, assumed";
    } memory<S> {}
}

law! {
    /// A 5/3 valve that is in one of three positions. The law's opening would give a force. At each sample the valve
    /// takes the position with the least cost of the difference to this force:
    ///
    ///   E^2 + dead_band^2 (solenoids that switch)
    ///
    /// E is the missing force at the end of the shortest pulse, N. The remainder is corrected later.
    pub struct Three {
        shortest_pulse: "s", above(0.0), "least time in a position, at least the travel time of the armature", rule "dead time and travel of the armature";
        dead_band: "N", at_least(0.0), "force that is missing when a solenoid switches", rule "half of the force of the shortest pulse at mid stroke";
    } memory<S> { switched: Switched<S> }
}

law! {
    /// Four 2/2 valves that are open or shut. They have seven modes: each chamber is filled, shut or vented, but not
    /// both filled or both vented. The law's opening would give a force. At each sample the valves take the mode with
    /// the least cost of the difference to this force:
    ///
    ///   (E_a - E_b)^2 + stiffness_share^2 (E_a + E_b)^2 + dead_band^2 (valves that switch)
    ///
    /// E_a and E_b are the missing forces of both chambers at the end of the shortest pulse, N. The stiffness is
    /// controlled as with two 3/2 valves. The remainder is corrected later.
    pub struct Seven {
        shortest_pulse: "s", above(0.0), "least time in a mode, at least the travel time of the armature", rule "dead time and travel of the armature";
        dead_band: "N", at_least(0.0), "force that is missing when a valve switches", rule "half of the force of the shortest pulse at mid stroke";
        stiffness: "N/m", above(0.0), "of the shut-in gas, where pressures allow it", rule "that of both chambers at the mean of supply and ambient pressure, mid stroke";
        rate: "1/s", at_least(0.0), "at which the stiffness follows", rule "a fifth of 0.22/lag, assumed";
        stiffness_share: "1", at_least(0.0), "weight of the stiffness beside the force", rule "0.3, assumed";
    } memory<S> { switched: Switched<S> }
}

law! {
    /// Four 2/2 valves under pulses: each valve is open for a fraction of each pulse. The following pulses make up
    /// for an opening that is too small for a pulse, or too large for a gap. The stiffness is controlled as with two
    /// 3/2 valves.
    pub struct Pulses {
        stiffness: "N/m", above(0.0), "of the shut-in gas, where pressures allow it", rule "that of both chambers at the mean of supply and ambient pressure, mid stroke";
        rate: "1/s", at_least(0.0), "at which the stiffness follows", rule "a fifth of 0.22/lag, assumed";
    } memory<S> { missing: [S; 2], open: [S; MOST_VALVES] }
}

/// Valves with their values and their state.
#[derive(Clone, Debug)]
pub enum Valves {
    /// One proportional 5/3 valve.
    One,
    /// See [`Pair`].
    Pair(Pair),
    /// See [`Three`].
    Three(Armature, Three),
    /// See [`Seven`].
    Seven(Armature, Seven),
    /// See [`Pulses`]; with their period, s.
    Pulses(Armature, f64, Pulses),
}

impl Valves {
    /// Valves with numbers that are derived from the drive.
    pub fn tuned(model: &Model, plant: &Plant, period: f64) -> Self {
        let stiffness = plant.natural_frequency * plant.natural_frequency * model.mass;
        let rate = STIFFNESS_RATE * plant.bandwidth();
        let pulse = model.valve.arrangement.armature().map_or(0.0, Armature::arrives);
        let band = 0.5 * plant.force_rate * samples(pulse, period) * period;
        match model.valve.arrangement {
            Arrangement::One => Valves::One,
            Arrangement::Pair => Valves::Pair(Pair::new(stiffness, rate)),
            Arrangement::Three(armature) => Valves::Three(armature, Three::new(pulse, band)),
            Arrangement::Seven(armature) => {
                Valves::Seven(armature, Seven::new(pulse, band, stiffness, rate, STIFFNESS_WEIGHT))
            }
            Arrangement::Pulses(armature, pulses) => {
                Valves::Pulses(armature, pulses, Pulses::new(stiffness, rate))
            }
        }
    }

    /// Their numbers, with key, unit, meaning and rule.
    pub fn gains(&mut self) -> GainValues<'_> {
        match self {
            Valves::One => vec![],
            Valves::Pair(own) => own.gains(),
            Valves::Three(_, own) => own.gains(),
            Valves::Seven(_, own) => own.gains(),
            Valves::Pulses(_, _, own) => own.gains(),
        }
    }

    /// Command before the observer has started: that of one 5/3 valve unchanged, and none for other valves.
    pub(crate) fn shut(&self, command: f64) -> Commands {
        match self {
            Valves::One => Commands::of([command]),
            Valves::Three(..) => Commands::of([0.0]),
            Valves::Pair(_) => Commands::of([0.0; 2]),
            Valves::Seven(..) | Valves::Pulses(..) => Commands::of([0.0; 4]),
        }
    }

    /// Returns the commands for a command of one 5/3 valve at a time, for a period, s, and passes them to the observer's spool.
    pub(crate) fn open(
        &mut self,
        model: &Model,
        observer: &mut Observer,
        [time, period]: [f64; 2],
        command: f64,
    ) -> Commands {
        let acts = time + model.valve.delay;
        if matches!(self, Valves::One) {
            observer.spool.command(acts, command);
            return Commands::of([command]);
        }
        let (state, _) = observer.predict(model, acts, period, 0.0);
        let share = model.share_of(command);
        let reach = Reach::of(model, &state);
        let spool = &mut observer.spool;
        match self {
            Valves::One => Commands::of([command]),
            Valves::Pair(own) => {
                let wanted = reach.wanted(share, Some([own.stiffness, own.rate]));
                let each = [0, 1].map(|i| model.command_for(reach.opening(i, wanted[i])));
                spool.command_both(acts, each);
                Commands::of(each)
            }
            Valves::Three(armature, own) => {
                let stays = samples(own.shortest_pulse.max(armature.arrives()), period);
                let (before, weights) = (own.switched.mode[0], [own.dead_band, 0.0]);
                let wanted = reach.wanted(share, None);
                let [now, _] = own.switched.choose(&reach, wanted, &THREE, weights, stays, period);
                switch_three(spool, armature, time, [before, now]);
                Commands::of([now])
            }
            Valves::Seven(armature, own) => {
                let wanted = reach.wanted(share, Some([own.stiffness, own.rate]));
                let stays = samples(own.shortest_pulse.max(armature.arrives()), period);
                let weights = [own.dead_band, own.stiffness_share];
                let before = own.switched.mode.map(edges);
                let now = own.switched.choose(&reach, wanted, &SEVEN, weights, stays, period).map(edges);
                for edge in 0..MOST_VALVES {
                    let [was, is] = [before, now].map(|mode| mode[edge / 2][edge % 2]);
                    if was != is {
                        spool.switch(edge, time + armature.at(is == 0.0, 0.5), is);
                    }
                }
                Commands::of([now[0][0], now[0][1], now[1][0], now[1][1]])
            }
            Valves::Pulses(armature, pulses, own) => {
                let wanted = reach.wanted(share, Some([own.stiffness, own.rate]));
                let each = [0, 1].map(|i| reach.opening(i, wanted[i]));
                own.pulse(each, armature, *pulses, spool, [time, period])
            }
        }
    }
}

/// Filling and venting of a chamber that is filled, shut or vented: 1, 0, -1.
fn edges(mode: f64) -> [f64; 2] {
    [mode.max(0.0), (-mode).max(0.0)]
}

/// Modes of the valves: chambers a and b filled, shut or vented.
const THREE: [[f64; 2]; 3] = [[0.0, 0.0], [1.0, -1.0], [-1.0, 1.0]];
const SEVEN: [[f64; 2]; 7] =
    [[0.0, 0.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1.0, 0.0], [0.0, 1.0]];

memory! {
    /// Modes, their residuals, and their durations.
    pub(crate) struct Switched<S> {
        /// Residuals of the forces of both chambers, N.
        missing: [S; 2],
        /// Samples for which no valve may switch.
        waits: S,
        /// Each chamber filled, shut or vented: 1, 0, -1.
        mode: [S; 2],
    }
}

impl Switched<f64> {
    /// The mode of a sample, for rates of both chambers' forces that are wanted, N/s. Weights are the force that is
    /// missing when a valve switches, N, and that of the stiffness relative to the force. A mode stays for some samples.
    fn choose(
        &mut self,
        reach: &Reach,
        wanted: [f64; 2],
        modes: &[[f64; 2]],
        [dead_band, share]: [f64; 2],
        stays: f64,
        period: f64,
    ) -> [f64; 2] {
        let span = stays * period;
        let left = |mode: [f64; 2], span: f64| {
            [0, 1].map(|i| self.missing[i] + (wanted[i] - reach.rate(i, mode[i])) * span)
        };
        let cost = |mode: [f64; 2]| {
            let [a, b] = left(mode, span);
            let switches: f64 = (0..2).map(|i| (mode[i] - self.mode[i]).abs()).sum();
            (a - b).powi(2) + (share * (a + b)).powi(2) + dead_band * dead_band * switches
        };
        let best = modes
            .iter()
            .copied()
            .fold(self.mode, |best, own| if cost(own) < cost(best) { own } else { best });
        let mode = if self.waits > 0.0 { self.mode } else { best };
        // A correction is limited to the effect of one pulse. A prediction that diverged corrects nothing.
        let most = |i: usize| reach.filled[i].abs().max(reach.vented[i].abs()) * span;
        let next = left(mode, period);
        self.waits = if mode == self.mode { (self.waits - 1.0).max(0.0) } else { stays - 1.0 };
        self.missing =
            [0, 1].map(|i| if most(i).is_finite() { next[i].clamp(-most(i), most(i)) } else { 0.0 });
        self.mode = mode;
        mode
    }
}

/// Moves a 5/3 switching valve from one position to another. Its edges open and shut within the half of the travel
/// next to the end.
fn switch_three(spool: &mut Spool, armature: &Armature, time: f64, [before, now]: [f64; 2]) {
    if before == now {
        return;
    }
    // Chambers a and b are filled and vented by edges 0 .. 3: those of position 1, then those of -1.
    for (position, pair) in [(1.0, [0, 3]), (-1.0, [1, 2])] {
        let (was, is) = (before == position, now == position);
        let after = match (was, is) {
            (true, false) if now == 0.0 => armature.at(true, 0.25),
            (true, false) => armature.at(false, 0.25),
            (false, true) if before == 0.0 => armature.at(false, 0.75),
            (false, true) => armature.at(false, 1.75),
            _ => continue,
        };
        pair.into_iter().for_each(|edge| spool.switch(edge, time + after, f64::from(u8::from(is))));
    }
}

impl Pulses {
    /// Converts fractions of opening of both chambers to fractions of pulses. A pulse uses the fractions of the last
    /// sample before it begins.
    fn pulse(
        &mut self,
        openings: [f64; 2],
        armature: &Armature,
        pulses: f64,
        spool: &mut Spool,
        [time, period]: [f64; 2],
    ) -> Commands {
        let begins = ((time / pulses + 1e-9).floor() + 1.0) * pulses;
        let counts = begins <= time + period * (1.0 + 1e-9);
        let [on, off] = [false, true].map(|back| armature.at(back, 0.5));
        let least = (armature.at(false, 1.0) + off - on) / pulses;
        let most = 1.0 - (armature.at(true, 1.0) + on - off) / pulses;
        let mut commands = [0.0; MOST_VALVES];
        for (side, opening) in openings.into_iter().enumerate() {
            let asked = opening + self.missing[side];
            let given = match asked.abs() {
                own if own < 0.5 * least => 0.0,
                own if own < 0.5 * (most + 1.0) => own.clamp(least, most.max(least)),
                _ => 1.0,
            };
            let share = if given > 0.0 && given < 1.0 { given - (off - on) / pulses } else { given };
            for (edge, own) in edges(share.copysign(asked)).into_iter().enumerate() {
                let edge = 2 * side + edge;
                commands[edge] = own;
                if counts {
                    let was_open = self.open[edge] > 0.0;
                    if own > 0.0 && !was_open {
                        spool.switch(edge, begins + on, 1.0);
                    } else if own == 0.0 && was_open {
                        spool.switch(edge, begins + off, 0.0);
                    }
                    if own > 0.0 && own < 1.0 {
                        spool.switch(edge, begins + own * pulses + off, 0.0);
                    }
                    self.open[edge] = f64::from(u8::from(own == 1.0));
                }
            }
            if counts {
                self.missing[side] = (asked - given.copysign(asked)).clamp(-1.0, 1.0);
            }
        }
        Commands::of(commands)
    }
}
