//! Ground floor: sample, state and plant of a drive, arrangement of its valves. These types do not depend on other
//! files.

use crate::number::memory;
use crate::thresholds::LEAST_LAG;
use math::Over;
use physics::chamber::GasState;

/// Readings of the sensors at a sample.
#[derive(Clone, Copy, Debug)]
pub struct Sample<S = f64> {
    /// Time, s.
    pub time: f64,
    /// Position, m.
    pub position: S,
    /// Pressures in chambers a and b, Pa absolute; `None`: they come from the model.
    pub pressures: Option<[S; 2]>,
}

memory! {
    /// The state of a drive that a law receives.
    pub struct State<S> {
        /// Position, m.
        pub position: S,
        /// Velocity, m/s.
        pub velocity: S,
        /// Force that is not part of the model, N in +x.
        pub disturbance: S,
        /// Friction force without its viscous part, N.
        pub friction: S,
        /// Pa absolute.
        pub pressures: [S; 2],
        /// Temperatures, K.
        pub temperatures: [S; 2],
    }
}

math::mapped!(State { position, velocity, disturbance, friction } arrays { pressures, temperatures });

impl<S: Over<f64>> State<S> {
    /// The gas of both chambers.
    pub fn gas(&self) -> [GasState<S>; 2] {
        gas_at(&[self.pressures, self.temperatures])
    }
}

/// The gas of both chambers at their pressures, Pa, and temperatures, K.
#[inline(always)]
pub(crate) fn gas_at<S: Over<f64>>([p, t]: &[[S; 2]; 2]) -> [GasState<S>; 2] {
    [0, 1].map(|side| GasState::at(p[side], t[side]))
}

/// Linear model of a drive at a place, from its description alone.
#[derive(Clone, Copy, Debug)]
pub struct Plant {
    /// Natural frequency of the mass on its air, shut in, rad/s.
    pub natural_frequency: f64,
    /// Its damping ratio.
    pub damping_ratio: f64,
    /// Steady speed for each fraction of opening, m/s.
    pub speed: f64,
    /// Rate of the force of a chamber at full opening, N/s.
    pub force_rate: f64,
    /// Time by which a command acts late, s: dead time, spool, half of the time for which it acts.
    pub lag: f64,
    /// Coulomb friction, N.
    pub coulomb: f64,
}

impl Plant {
    /// Bandwidth that leaves a margin for the lag, 0.22/lag, rad/s.
    pub fn bandwidth(&self) -> f64 {
        0.22 / self.lag.max(LEAST_LAG)
    }
}

/// Times of the armature of a switching valve, for opening and for closing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Armature {
    /// Time from a command until the armature moves, s.
    pub dead: [f64; 2],
    /// Time for which the armature moves, s.
    pub travel: [f64; 2],
}

impl Armature {
    /// Time from a command until the spool has covered a fraction of its way, s.
    pub(crate) fn at(&self, back: bool, share: f64) -> f64 {
        self.dead[usize::from(back)] + share * self.travel[usize::from(back)]
    }

    /// A time in which the armature arrives in either direction, s.
    pub(crate) fn arrives(&self) -> f64 {
        self.at(false, 1.0).max(self.at(true, 1.0))
    }

    /// The mean, over both directions, of the time to the middle of the way, s.
    pub fn mean(&self) -> f64 {
        0.5 * (self.at(false, 0.5) + self.at(true, 0.5))
    }
}

/// Arrangement of the valves of a circuit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arrangement {
    /// One proportional 5/3 valve.
    One,
    /// Two proportional 3/2 valves, at chambers a and b.
    Pair,
    /// One 5/3 switching valve with a shut centre.
    Three(Armature),
    /// Four 2/2 switching valves: filling and venting a, filling and venting b.
    Seven(Armature),
    /// The same valves, commanded by pulses with a period, s.
    Pulses(Armature, f64),
}

impl Arrangement {
    /// True if the valves open by any fraction; otherwise they switch.
    pub fn is_proportional(&self) -> bool {
        self.armature().is_none()
    }

    /// The armature of valves that switch.
    pub fn armature(&self) -> Option<&Armature> {
        match self {
            Arrangement::One | Arrangement::Pair => None,
            Arrangement::Three(armature)
            | Arrangement::Seven(armature)
            | Arrangement::Pulses(armature, _) => Some(armature),
        }
    }

    /// Returns how long a command of a law that is sampled with a period acts at least, s.
    pub fn acts_for(&self, period: f64) -> f64 {
        match (self, self.armature()) {
            (Arrangement::Pulses(_, pulses), _) => *pulses,
            (_, Some(armature)) => samples(armature.arrives(), period) * period,
            (_, None) => period,
        }
    }
}

/// Influence of other axes that move the same body, at one sample. The accelerations a of all axes need the forces
///
///   F_i = sum A_ij a_j,   A = J^-T M J^-1
///
/// while an axis alone would need m_i a_i.
#[derive(Clone, Copy, Debug)]
pub struct Coupled {
    /// Load by which the forces of the others deviate from their plans, N in +x: before the sample, and until the command
    /// of the sample acts.
    pub loads: [f64; 2],
    /// Force, N, and its rate, N/s, on this axis that the feedback of all axes needed at the last sample.
    pub feedback: [f64; 2],
}

/// Valves of a drive at most.
pub const MOST_VALVES: usize = 4;

/// Number of samples in a time.
pub(crate) fn samples(time: f64, period: f64) -> f64 {
    (time / period - 1e-6).ceil().max(1.0)
}

/// Edges that open: filling and venting of chambers a and b.
pub type Edges<S> = [[S; 2]; 2];
