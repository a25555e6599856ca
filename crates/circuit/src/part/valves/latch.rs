use crate::ground::{Between, Net, Own, OwnMut, PRESSURE_TOLERANCE, Part, gathered, one_path};
use math::{Lane, Over};
use physics::flow::Iso6358;

/// Least ratio of the inlet's opening pressure to its closing pressure, so that both are not one event (assumed).
const ABOVE_RESET: f64 = 1.2;

gathered! {
    /// The seat of a soft-start valve. The flow path is a needle until the pressure behind it has risen, then it is
    /// open:
    ///
    /// * It opens if `p2 - p_amb > s (p1 - p_amb)` and `p1 > 1.2 p_reset`.
    /// * It closes if `p1 < p_reset`.
    ///
    /// * `s`: fraction of the inlet's gauge pressure.
    pub struct Latch {
        numbers {
            /// Fraction of the conductance while it is shut.
            needle_share,
            opening_share,
            reset_pressure,
            ambient_pressure,
            /// One while it is open, zero while it is shut.
            mode,
        }
        laws { law: Iso6358 }
        same { path: Between }
    }
}

impl<P: Lane> Latch<P> {
    /// Distances of the pressures from the opening condition, Pa. Negative beyond it.
    fn before_opening(&self, net: &Net<P>) -> P {
        let (p1, p2) = (net[self.path.from].p, net[self.path.to].p);
        let share = self.opening_share * (p1 - self.ambient_pressure) - (p2 - self.ambient_pressure);
        share.max(P::c(ABOVE_RESET) * self.reset_pressure - p1)
    }
}

impl<P: Lane> Part<P> for Latch<P> {
    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let share = self.needle_share + self.mode * (P::one() - self.needle_share);
        self.law.flow(S::from(share), &one.end(), &two.end())
    }

    fn events(&self) -> &'static [f64] {
        &[PRESSURE_TOLERANCE]
    }

    fn event(&self, _event: usize, _y: Own<P>, net: &Net<P>) -> P {
        let above_reset = net[self.path.from].p - self.reset_pressure;
        P::select(self.mode.lt(P::c(0.5)), self.before_opening(net), above_reset)
    }

    fn mode_mut(&mut self, _event: usize) -> &mut P {
        &mut self.mode
    }

    fn find_mode(&mut self, _event: usize, _y: OwnMut<P>, net: &Net<P>) {
        self.mode = P::select(self.before_opening(net).lt(P::zero()), P::one(), P::zero());
    }
}
