//! Common parts of the laws of elastic bristles: the fade of their damping and the conditions of passivity.

use super::{InnerState, Levels};
use math::{Over, Real};

/// The mean deflection of the bristles.
pub(super) const DEFLECTION: InnerState = InnerState { name: "bristle_deflection_m", unit: "m", scale: 1e-3 };

/// [`crate::parameters!`] of a bristle law: those of the Stribeck curve, of the bristles, and then specific ones.
macro_rules! bristle_parameters {
    ($(#[$attribute:meta])* pub struct $name:ident { $($own:tt)* }) => {
        $crate::friction::stribeck::stribeck_parameters! {
            $(#[$attribute])*
            pub struct $name {
                /// Bristle stiffness sigma0
                bristle_stiffness: "N/m", $crate::parameter::above(0.0);
                /// Bristle damping sigma1
                bristle_damping: "N s/m", $crate::parameter::at_least(0.0);
                /// Velocity vd at which the bristle damping fades; infinite: it does not fade
                damping_fade_velocity: "m/s", $crate::parameter::at_least(f64::MIN_POSITIVE), default f64::INFINITY;
                $($own)*
            } with {
                /// The bristle damping fades
                faded: bool,
            }
        }

        impl $crate::friction::Described for $name<f64> {
            fn build(values: &[f64], choices: &$crate::friction::Choices) -> Self {
                let shape = $crate::friction::Shape::of(choices, values[3]);
                $name::from_values(values, shape, values[7].is_finite())
            }

            fn warning(&self, levels: &$crate::friction::Levels<f64>) -> Option<String> {
                let (damping, fade_velocity) = (self.bristle_damping, self.damping_fade_velocity);
                let passivity = $crate::friction::bristles::Passivity { damping, fade_velocity };
                passivity.warning(<$name<f64> as $crate::friction::Law<f64>>::KEY, levels)
            }
        }

        impl<P: math::Real> $name<P> {
            /// Returns sigma1(v).
            #[inline(always)]
            fn damping_at<S: math::Over<P>>(&self, v: S) -> S {
                let (sigma_1, fade_velocity) = (self.bristle_damping, self.damping_fade_velocity);
                $crate::friction::bristles::damping(v, sigma_1, fade_velocity, self.faded)
            }

            /// Returns sigma0 z + sigma1(v) dz/dt + Fv v.
            #[inline(always)]
            fn force_of<S: math::Over<P>>(&self, v: S, viscous: S, elastic: S, rate: S) -> S {
                viscous.fma(v, self.damping_at(v).fma(rate, elastic))
            }
        }
    };
}
pub(super) use bristle_parameters;

/// Inside `impl Law` for a bristle law: its levels and its bristles.
macro_rules! bristle_law {
    () => {
        $crate::friction::levels_of!(coulomb breakaway viscous, spring bristle_stiffness);

        fn damping<S: Over<P>>(&self, v: S) -> S {
            self.damping_at(v)
        }
    };
}
pub(super) use bristle_law;

/// Returns sigma1(v) = sigma1 exp(-(v/vd)^2), N s/m. Constant unless it is `faded`.
#[inline(always)]
pub(super) fn damping<P: Real, S: Over<P>>(v: S, sigma_1: P, fade_velocity: P, faded: bool) -> S {
    if faded {
        let ratio = v / S::from(fade_velocity);
        S::from(sigma_1) * (-(ratio * ratio)).exp()
    } else {
        S::from(sigma_1)
    }
}

/// Conditions under which bristles cannot produce energy.
///
/// Passive if Fv >= sigma1 (Fs - Fc)/Fc, or with a fade if sigma1 vd/sqrt(2 e) <= 4 Fc. The conditions are those of
/// LuGre [barabanov2000]. An elasto-plastic law meets them too, because it differs only at bristle forces below the
/// level.
pub(super) struct Passivity {
    pub damping: f64,
    /// Infinite: the damping does not fade.
    pub fade_velocity: f64,
}

impl Passivity {
    pub fn holds(&self, levels: &Levels<f64>) -> bool {
        levels.viscous >= self.viscous_needed(levels) || self.fade_excess(levels) <= 1.0
    }

    fn viscous_needed(&self, levels: &Levels<f64>) -> f64 {
        self.damping * (levels.breakaway - levels.coulomb) / levels.coulomb
    }

    /// The largest sigma1(v) |v|, at v = vd/sqrt 2, over its bound 4 Fc.
    fn fade_excess(&self, levels: &Levels<f64>) -> f64 {
        let largest = self.damping * self.fade_velocity / (2.0 * std::f64::consts::E).sqrt();
        largest / (4.0 * levels.coulomb)
    }

    pub fn warning(&self, law: &str, levels: &Levels<f64>) -> Option<String> {
        if self.holds(levels) {
            return None;
        }
        // Rounded for reading: 500, not 499.99999999999994.
        let rounded = |x: f64| (1e6 * x).round() / 1e6;
        let fade = 4.0 * levels.coulomb * (2.0 * std::f64::consts::E).sqrt() / self.damping;
        Some(format!(
            "this {law} set is not passive: viscous = {} N s/m is below bristle_damping (breakaway - coulomb)/coulomb = {} N s/m \
             (coulomb {} N, breakaway {} N), so friction can give energy during fast transients; \
             friction.damping_fade_velocity = \"{:.3} m/s\" or less makes it passive",
            levels.viscous,
            rounded(self.viscous_needed(levels)),
            rounded(levels.coulomb),
            rounded(levels.breakaway),
            fade
        ))
    }
}
