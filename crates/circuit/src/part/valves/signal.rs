//! Signals between parts: positions of a valve's edges, and a commanded pressure.

use crate::ground::{Common, Given, Net, Own, OwnMut, Part, State, first_is_a_signal, gathered, inputs};
use math::{Lane, Over, Real};
use physics::constants::P_0;
use physics::flow::leaking;

/// Signals of a valve: the acting command, the state of its play, and the given command.
pub(crate) const ACTS: usize = 0;
pub(crate) const REMEMBERED: usize = 1;
pub(crate) const COMMANDED: usize = 2;

const COMMAND: physics::Bounds = physics::within(-1.0, 1.0);

macro_rules! commanded {
    ($acts:literal, $bounds:expr) => {
        inputs! {
            acts: $acts, "1", $bounds;
            remembered: "command behind the play", "1", COMMAND;
            commanded: "command", "1", COMMAND;
        }
    };
}

gathered! {
    /// A spool that follows its command at once.
    pub struct Held {
        numbers { acts, remembered, commanded }
        same {
            /// Index of its position among the signals.
            signal: usize,
        }
    }
}

impl<P: Lane> Part<P> for Held<P> {
    commanded!("command that acts", COMMAND);

    #[inline(always)]
    fn place<S: Over<P>>(&self, _y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        net.signal[self.signal] = S::from(self.acts);
    }
}

gathered! {
    /// A spool of second order with limited speed. See [`follows`]. Its position goes from -1 to 1, and its top speed
    /// is in 1/s.
    pub struct Spool {
        numbers { acts, remembered, commanded, angular_frequency, damping_ratio, top_speed }
        same {
            /// Index of its position among the signals.
            signal: usize,
        }
    }
}

/// Time constants after which a spool has forgotten its position: it is within 1e-9 of its command.
const MEMORY: f64 = 21.0;
/// Step of a coasting spool, in its shortest time constant: its error is below 1e-7 of a change.
const STEP: f64 = 0.05;

impl<P: Lane> Spool<P> {
    /// Returns position and speed a time `lapse`, s, later, under the command that acts. `left` is the time after that
    /// until they matter: a spool that forgets within it has arrived. Runge and Kutta's method of order 4.
    pub(crate) fn coasted(&self, mut y: [P; 2], lapse: f64, left: f64) -> [P; 2] {
        let numbers = [self.angular_frequency, self.damping_ratio, self.top_speed];
        let [w, zeta, top] = numbers.map(|number| number.get(0));
        if left > MEMORY * (2.0 * zeta).max(1.0 / zeta) / w + 2.0 / top {
            return [self.acts, P::zero()];
        }
        let steps = (lapse * w * (2.0 * zeta).max(1.0) / STEP).ceil();
        let rates = |y| follows(y, self.acts, numbers);
        let moved =
            |y: [P; 2], rates: [P; 2], share| [0, 1].map(|i| y[i] + P::c(share * lapse / steps) * rates[i]);
        for _ in 0..steps as usize {
            let a = rates(y);
            let b = rates(moved(y, a, 0.5));
            let c = rates(moved(y, b, 0.5));
            let d = rates(moved(y, c, 1.0));
            y = moved(y, [0, 1].map(|i| a[i] + P::c(2.0) * (b[i] + c[i]) + d[i]), 1.0 / 6.0);
        }
        y
    }
}

impl<P: Lane> Part<P> for Spool<P> {
    commanded!("command that acts", COMMAND);

    fn states(&self) -> Vec<State> {
        // Speed of a full stroke within one radian.
        vec![State::own("position", "1", 1.0), State::own("speed_1_s", "1/s", SPEED)]
    }

    first_is_a_signal!(signal);

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnMut<S>, _net: &mut Net<S>, _common: &Common<P>) {
        let laws = [self.angular_frequency, self.damping_ratio, self.top_speed].map(S::from);
        dy.set(follows(y.first(), S::from(self.acts), laws));
    }

    fn begin(&self, _given: &Given<P>, mut y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {
        y.set([self.acts, P::zero()]);
    }
}

gathered! {
    /// Leaking fraction of the conductance past each edge of a spool, one number for all edges:
    ///
    ///   `l exp(-|x|/x_l)`
    ///
    /// * `l`: leaking fraction at x = 0.
    /// * `x_l`: position over which the leak falls to 1/e.
    pub struct SpoolLeak {
        numbers { leak, width }
        same {
            /// Indices of the position and of the fraction among the signals.
            position: usize,
            signal: usize,
        }
    }
}

impl<P: Lane> Part<P> for SpoolLeak<P> {
    #[inline(always)]
    fn place<S: Over<P>>(&self, _y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        let x = net.signal[self.position];
        net.signal[self.signal] = leaking(S::from(self.leak), S::from(self.width), x);
    }
}

/// Error scale of a spool's speed, 1/s: a tenth of a stroke in a millisecond.
const SPEED: f64 = 100.0;

gathered! {
    /// An armature that travels at a set rate: x' = r. The schedule that sets the rate also ends it after the travel.
    pub struct Armature {
        numbers { acts, remembered, commanded }
        same {
            /// Index of its position among the signals.
            signal: usize,
        }
    }
}

impl<P: Lane> Part<P> for Armature<P> {
    commanded!("rate", physics::any());

    fn states(&self) -> Vec<State> {
        vec![State::own("position", "1", 1.0)]
    }

    first_is_a_signal!(signal);

    #[inline(always)]
    fn rate<S: Over<P>>(&self, _y: Own<S>, mut dy: OwnMut<S>, _net: &mut Net<S>, _common: &Common<P>) {
        dy.set([S::from(self.acts)]);
    }

    fn begin(&self, given: &Given<P>, mut y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {
        y.set([given.signal(self.signal).unwrap_or(self.commanded)]);
    }
}

/// Computes the rates of x and v for a second-order system with limited speed, in which x follows u:
///
///   `x' = v,   v' = 2 zeta w (clip(w/(2 zeta) (u - x), -v_max, v_max) - v)`
///
/// so x'' + 2 zeta w x' + w^2 x = w^2 u below the limit, and a steady v_max at the limit.
///
/// * `w`: natural angular frequency, rad/s.
/// * `zeta`: damping ratio.
/// * `v_max`: largest speed of x, unit of x per s.
#[inline(always)]
fn follows<S: Real>([x, v]: [S; 2], u: S, [w, zeta, top]: [S; 3]) -> [S; 2] {
    let double = zeta + zeta;
    let wanted = (w / double * (u - x)).max(-top).min(top);
    [v, double * w * (wanted - v)]
}

gathered! {
    /// A pressure that follows a command, Pa. See [`follows`].
    pub struct SecondOrder {
        numbers { command, angular_frequency, damping_ratio }
        same {
            /// Absolute error scale of the rate, Pa/s.
            rate_scale: f64,
            /// Index of x among the signals.
            signal: usize,
        }
    }
}

impl<P: Lane> Part<P> for SecondOrder<P> {
    fn states(&self) -> Vec<State> {
        vec![
            State::own("acting_set_pressure_pa", "Pa", P_0),
            State::own("acting_set_pressure_rate_pa_s", "Pa/s", self.rate_scale),
        ]
    }

    inputs! { command: "command", "Pa", physics::above(0.0) }

    first_is_a_signal!(signal);

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnMut<S>, _net: &mut Net<S>, _common: &Common<P>) {
        let [w, zeta] = [self.angular_frequency, self.damping_ratio].map(S::from);
        dy.set(follows(y.first(), S::from(self.command), [w, zeta, S::c(f64::INFINITY)]));
    }

    fn begin(&self, _given: &Given<P>, mut y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {
        y.set([self.command, P::zero()]);
    }
}
