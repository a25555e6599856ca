//! Forces between two axes.

use crate::ground::{Common, Kind, Net, Own, OwnMut, Part, Switching, force_on, gathered};
use crate::part::mechanics::damper;
use math::{Lane, Over};
use physics::mechanics::EndStop;
use std::f64::consts::PI;

gathered! {
    /// Spring and damper between two axes, without play: a force sensor, a coupling.
    ///
    ///   F = k (x_from - x_to) + c (v_from - v_to)              [N], in +x on `to`, -F on `from`
    pub struct Link {
        numbers { stiffness, damping }
        same { from: usize, to: usize }
    }
}

impl<P: Lane> Part<P> for Link<P> {
    /// Returns the force in +x on `to`, N.
    #[inline(always)]
    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        let (stretch, rate) = net.apart(self.from, self.to);
        S::from(self.stiffness) * stretch + S::from(self.damping) * rate
    }

    force_on!(to, from);

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        let (stretch, _) = net.apart(self.from, self.to);
        [S::zero(), S::c(0.5) * S::from(self.stiffness) * stretch * stretch, S::zero()]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        damper::CHANNELS.to_vec()
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let (_, speed) = net.apart(self.from, self.to);
        damper::account(S::from(self.damping) * speed * speed, common, out);
    }
}

gathered! {
    /// A coupling with play between two axes. Within the play the force is zero. Beyond it, on either side, they meet
    /// as at an end stop.
    ///
    ///   F = f(z - g/2, z') - f(-z - g/2, -z'),   z = x_from - x_to          [N], in +x on `to`, -F on `from`
    pub struct Coupling {
        numbers {
            /// Play g between both sides, m.
            play,
        }
        laws { law: EndStop }
        same { from: usize, to: usize }
    }
}

impl<P: Lane> Coupling<P> {
    fn spring_energy<S: Over<P>>(&self, net: &Net<S>) -> S {
        let depth = (net.apart(self.from, self.to).0.abs() - S::c(0.5) * S::from(self.play)).max(S::zero());
        S::c(0.5) * S::from(self.law.stiffness) * depth * depth
    }
}

impl<P: Lane> Part<P> for Coupling<P> {
    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        let (z, rate) = net.apart(self.from, self.to);
        let half = S::c(0.5) * S::from(self.play);
        self.law.force(z - half, rate) - self.law.force(-z - half, -rate)
    }

    force_on!(to, from);

    damper::springs!(spring_energy);

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        damper::account(self.force(net) * net.apart(self.from, self.to).1, common, out);
    }
}

/// Depth of the event, m: much less than any step resolves.
const TOLERANCE: f64 = 1e-9;

gathered! {
    /// Magnets that couple two axes:
    ///
    ///   `F = F_h sin(pi D/L_p) + c D',   D = x_from - x_to                 [N], in +x on to, -F on from`
    ///
    /// This holds until |D| reaches L_p/2, where the force is largest. Beyond this, the force is zero until |D| is
    /// below L_p/4 again.
    /// Decoupled magnets keep their energy at L_p/4, so that the new coupling neither takes nor gives energy. The
    /// remaining energy at L_p/2 becomes heat. Whether the axes couple after an approach depends on the energy.
    ///
    /// * `F_h`: holding force, N.
    /// * `L_p`: pole pitch, m.
    /// * `c`: damping, N s/m.
    pub struct Magnet {
        numbers {
            holding_force,
            pole_pitch,
            damping,
            /// One while they are decoupled, zero while they are coupled.
            mode,
        }
        same {
            from: usize,
            to: usize,
            /// Index of the mode among the signals.
            signal: usize,
        }
    }
}

impl<P: Lane> Magnet<P> {
    /// F_h L_p/pi (1 - cos(pi D/L_p)), with D = L_p/4 for decoupled magnets.
    fn energy<S: Over<P>>(&self, net: &Net<S>) -> S {
        let pitch = S::from(self.pole_pitch);
        let mode = S::from(self.mode);
        let apart = net.apart(self.from, self.to).0 * (S::one() - mode) + S::c(0.25) * pitch * mode;
        let wave = S::c(PI) / pitch;
        S::from(self.holding_force) / wave * (S::one() - (wave * apart).cos())
    }
}

impl<P: Lane> Part<P> for Magnet<P> {
    #[inline(always)]
    fn place<S: Over<P>>(&self, _y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        net.signal[self.signal] = S::from(self.mode);
    }

    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        let (apart, rate) = net.apart(self.from, self.to);
        let angle = S::c(PI) / S::from(self.pole_pitch) * apart;
        let force = S::from(self.holding_force) * angle.sin() + S::from(self.damping) * rate;
        S::from(P::one() - self.mode) * force
    }

    force_on!(to, from);

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        [S::zero(), self.energy(net), S::zero()]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        damper::CHANNELS.to_vec()
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let rate = net.apart(self.from, self.to).1;
        damper::account(S::from((P::one() - self.mode) * self.damping) * rate * rate, common, out);
    }

    fn events(&self) -> &'static [f64] {
        &[TOLERANCE]
    }

    fn event(&self, _event: usize, _y: Own<P>, net: &Net<P>) -> P {
        let (apart, pitch) = (net.apart(self.from, self.to).0.abs(), self.pole_pitch);
        P::select(self.mode.lt(P::c(0.5)), P::c(0.5) * pitch - apart, apart - P::c(0.25) * pitch)
    }

    fn mode_mut(&mut self, _event: usize) -> &mut P {
        &mut self.mode
    }

    fn switch(&mut self, Switching { lane, net, common, accounts, .. }: Switching<P>) {
        let before = self.energy(net);
        self.mode.put(lane, 1.0 - self.mode.get(lane));
        if let [heat, entropy] = accounts {
            let lost = (before - self.energy(net)).get(lane);
            heat.put(lane, heat.get(lane) - lost);
            entropy.put(lane, entropy.get(lane) + lost / common.ambient_temperature.get(lane));
        }
    }

    /// They start coupled unless they are too far apart.
    fn find_mode(&mut self, _event: usize, _y: OwnMut<P>, net: &Net<P>) {
        let is_near = net.apart(self.from, self.to).0.abs().lt(P::c(0.5) * self.pole_pitch);
        self.mode = P::select(is_near, P::zero(), P::one());
    }
}
