use crate::ground::{Common, Given, Kind, Net, Own, OwnMut, Part, State, inputs};
use math::{Lane, Over};
use std::f64::consts::TAU;

physics::parameters! {
    /// A servo axis: a commanded motion of piecewise constant jerk, and the carriage that follows it.
    ///
    ///   `commanded   dx/dt = v,  dv/dt = a,  da/dt = jerk`
    ///   `following   dv_f/dt = w^2 (x - x_f) + 2 zeta w (v - v_f),  dx_f/dt = v_f`
    ///   `carriage    x_f + r/kappa sin(kappa x_f),  so its velocity is v_f [1 + r cos(kappa x_f)]`
    ///   `compliance  m dv_f/dt = F - c v_f`
    ///
    /// A position loop of natural frequency w with velocity feedforward: no lag at constant speed. The ripple is that
    /// of a ball screw or of cogging, with period 2 pi/kappa. The axis is infinitely strong, so that no force changes
    /// its motion. The exception is admittance control: a virtual mass m and damper c then let the force F on the
    /// carriage move it until F is zero. Position, velocity and acceleration are states, so that the commanded motion
    /// is exact and the equations stay free of time. A carriage without lag equals its command: x_f = x, v_f = v.
    pub struct Carriage {
        /// Jerk: an input
        jerk: "m/s3", physics::any(), default 0.0;
        /// Natural frequency w of the position loop
        frequency: "rad/s", physics::above(0.0), default 1.0;
        /// Damping ratio zeta of the position loop
        damping_ratio: "-", physics::at_least(0.0), default 1.0;
        /// Relative velocity ripple r
        ripple: "-", physics::at_least(0.0), default 0.0;
        /// Wave number kappa of the ripple
        wave_number: "1/m", physics::above(0.0), default 1.0;
        /// Virtual mass m during admittance control
        virtual_mass: "kg", physics::above(0.0), default 1.0;
        /// Virtual damping c during admittance control
        virtual_damping: "N s/m", physics::at_least(0.0), default 0.0;
        /// 1 during admittance control, else 0: an input
        giving_way: "-", physics::at_least(0.0), default 0.0;
    } with {
        /// Index among the axes of the net
        node: usize,
        /// Whether it follows its command with a lag
        follows: bool,
        /// Whether its velocity ripples
        ripples: bool,
        /// Whether its input may enable admittance control
        can_give_way: bool,
    }
}

/// Offset of x_f, v_f within the states of a carriage with lag.
pub(crate) const FOLLOWER: usize = 3;

impl<P: Lane> Carriage<P> {
    /// Creates an axis that equals its command, without compliance.
    pub fn rigid() -> Self {
        let defaults = Self::PARAMETERS.iter().map(|own| P::c(own.default.expect("a number with a default")));
        Carriage::from_values(&defaults.collect::<Vec<_>>(), 0, false, false, false)
    }

    /// Creates an axis that follows with a natural frequency in rad/s and a damping ratio.
    pub fn following(self, frequency: P, damping_ratio: P) -> Self {
        Carriage { frequency, damping_ratio, follows: true, ..self }
    }

    /// Adds a velocity ripple of this amplitude with the period `pitch`, m.
    pub fn rippling(self, ripple: P, pitch: P) -> Self {
        Carriage { ripple, wave_number: P::c(TAU) / pitch, ripples: true, ..self }
    }

    /// Adds admittance control for a spring of `stiffness` N/m, critically damped, with this time constant, s.
    pub fn yielding(self, stiffness: P, time: P) -> Self {
        Carriage {
            virtual_mass: stiffness * time * time,
            virtual_damping: P::c(2.0) * stiffness * time,
            can_give_way: true,
            ..self
        }
    }

    /// Returns the offset of x_f, v_f within the part's states.
    pub(crate) fn follower(&self) -> usize {
        if self.follows { FOLLOWER } else { 0 }
    }

    /// Returns x_f and v_f.
    #[inline(always)]
    fn followed<S: Over<P>>(&self, y: Own<S>) -> [S; 2] {
        if self.follows {
            let [.., x, v] = y.first::<5>();
            [x, v]
        } else {
            y.first()
        }
    }

    /// Returns the acceleration under admittance control.
    #[inline(always)]
    fn yielded<S: Over<P>>(&self, a: S, v: S, net: &Net<S>) -> S {
        if !self.can_give_way {
            return a;
        }
        let force = net.axis[self.node].force - S::from(self.virtual_damping) * v;
        a + S::from(self.giving_way) * (force / S::from(self.virtual_mass) - a)
    }
}

impl<P: Lane> Part<P> for Carriage<P> {
    fn states(&self) -> Vec<State> {
        let own = [State::own("position_m", "m", 0.1), State::own("velocity_m_s", "m/s", 0.1)];
        if !self.follows {
            return own.into_iter().chain([State::own("acceleration_m_s2", "m/s2", 1.0)]).collect();
        }
        let commanded = [
            State::own("commanded_position_m", "m", 0.1),
            State::own("commanded_velocity_m_s", "m/s", 0.1),
            State::own("commanded_acceleration_m_s2", "m/s2", 1.0),
        ];
        commanded.into_iter().chain(own).collect()
    }

    fn begin(&self, given: &Given<P>, mut y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {
        if let Some(start) = given.axis(self.node) {
            y.set(start);
            y.after(self.follower())[..2].copy_from_slice(&start);
        }
    }

    inputs! {
        jerk: "jerk", "m/s3", physics::any();
        giving_way: "giving way", "1", physics::within(0.0, 1.0);
    }

    #[inline(always)]
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        let [x, v] = self.followed(y);
        let node = &mut net.axis[self.node];
        (node.x, node.v) = (x, v);
        if self.ripples {
            let (kappa, ripple) = (S::from(self.wave_number), S::from(self.ripple));
            let angle = kappa * x;
            node.x = (ripple / kappa).fma(angle.sin(), x);
            node.v = (ripple * v).fma(angle.cos(), v);
        }
        node.force = S::zero();
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnMut<S>, net: &mut Net<S>, _common: &Common<P>) {
        let [x, v, a] = y.first();
        let jerk = S::from(self.jerk);
        let [x_f, v_f] = self.followed(y);
        let a_f = if self.follows {
            let w = S::from(self.frequency);
            let track = w * (w * (x - x_f) + S::from(self.damping_ratio) * S::c(2.0) * (v - v_f));
            let a_f = self.yielded(track, v_f, net);
            dy.set([v, a, jerk, v_f, a_f]);
            a_f
        } else {
            let a_f = self.yielded(a, v, net);
            dy.set([v, a_f, jerk]);
            a_f
        };
        net.axis[self.node].a = if self.ripples {
            let (kappa, ripple) = (S::from(self.wave_number), S::from(self.ripple));
            let angle = kappa * x_f;
            a_f + ripple * (a_f * angle.cos() - kappa * v_f * v_f * angle.sin())
        } else {
            a_f
        };
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        vec![("work of the driven end", Kind::Energy)]
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, _common: &Common<P>, out: &mut [S]) {
        let node = &net.axis[self.node];
        out[0] = -node.force * node.v;
    }
}
