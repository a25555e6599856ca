use crate::ground::{Common, Given, Net, Own, OwnMut, Part, State, first_is_a_signal, gathered, inputs};
use math::{Lane, Over, Real};
use physics::constants::P_0;

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
pub(crate) fn follows<S: Real>([x, v]: [S; 2], u: S, [w, zeta, top]: [S; 3]) -> [S; 2] {
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
