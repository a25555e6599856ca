use super::bristles::{DEFLECTION, bristle_law, bristle_parameters};
use super::{At, FLOOR, InnerState, Law, Levels, sliding};
use crate::parameter::{above, any, at_least};
use math::{Over, Real};

/// Exponent of the steady film over the velocity. Assumed: the value of the source is not accessible.
const FILM_EXPONENT: f64 = 2.0 / 3.0;

/// Lower limit of |v|/vb in the steady film, whose slope at rest would be infinite. It changes the film by less than
/// 1e-8 of its largest thickness.
const SMALLEST_RATIO: f64 = 1e-12;

/// Relative film thickness h: 0 is a contact without film, and 1 - Fc/Fs is the thickest film.
const FILM: InnerState = InnerState { name: "film_thickness", unit: "-", scale: 1.0 };

bristle_parameters! {
    /// Modified LuGre of Yanada and Tran: bristles under a film of lubricant that grows and shrinks with a lag.
    ///
    ///   `dz/dt = v - sigma0 |v| z / g(v, h)`
    ///   `g(v, h) = Fc + max((1 - h) Fs - Fc, 0) exp(-|v/vs|^n)`
    ///   `dh/dt = (h_ss - h) [(1 - r)/tau + r/tau_0],    h_ss = (1 - Fc/Fs) min(|v|/vb, 1)^(2/3)`
    ///   `tau = tau_p for h <= h_ss (the film grows), tau_n for h > h_ss;   r = exp(-(v/vr)^2)`
    ///   `vs = vs_0 + s_a (p_a - p_amb) + s_b (p_b - p_amb), not less than a hundredth of vs_0`
    ///   `F = sigma0 z + sigma1(v) dz/dt + Fv (v + Tf dv/dt)             [N], opposes v > 0`
    ///
    /// * `h`: film thickness relative to the thickness without solid contact.
    /// * `Tf`: lead of viscous friction: Fv Tf moves along as a mass (`inertia`), s.
    ///
    /// Below vb, friction is not a function of velocity. Faster changes open a loop, which is wider at higher
    /// frequency. At rest the film is squeezed out with tau_0. Breakaway then grows exponentially with the stop, from
    /// the value after the last sliding to Fs.
    ///
    /// The source switches to tau_0 at v = 0 exactly, which bristles never reach. Here r does this below vr, and from 3
    /// vr on it contributes less than 1.3e-4 of the rate. max() protects against levels that fall under pressure.
    /// Otherwise h <= 1 - Fc/Fs. Passive under the conditions of LuGre, because g is between Fc and Fs. Source:
    /// [tran2013]. Only its abstract was accessible, not the tables of values.
    pub struct FilmLuGre {
        /// Velocity vb above which the film is thickest
        film_velocity: "m/s", above(0.0);
        /// Time constant tau_p of a film that grows
        film_growth_time: "s", above(0.0);
        /// Time constant tau_n of a film that shrinks in sliding
        film_decay_time: "s", above(0.0);
        /// Time constant tau_0 of a film that is squeezed out at rest
        film_rest_time: "s", above(0.0);
        /// Velocity vr below which the contact counts as at rest for the film
        film_rest_velocity: "m/s", above(0.0), default 1e-6;
        /// Lead Tf of viscous friction
        fluid_lead_time: "s", at_least(0.0), default 0.0;
        /// Stribeck velocity per gauge pressure in chamber a
        stribeck_velocity_a: "m/(s Pa)", any(), default 0.0;
        /// Stribeck velocity per gauge pressure in chamber b
        stribeck_velocity_b: "m/(s Pa)", any(), default 0.0;
    }
}

impl<P: Real> FilmLuGre<P> {
    /// Returns s(v) with the Stribeck velocity under pressure.
    fn pressed_weight<S: Over<P>>(&self, at: &At<S>) -> S {
        let vs = S::from(self.stribeck_velocity);
        let (a, b) = (S::from(self.stribeck_velocity_a), S::from(self.stribeck_velocity_b));
        let pressed = a.fma(at.gauge_a, b.fma(at.gauge_b, vs)).max(S::c(FLOOR) * vs);
        self.weight(at.v * (vs / pressed))
    }

    /// Returns h_ss: the film of steady sliding.
    fn steady_film<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
        let greatest = (S::one() - levels.coulomb / levels.breakaway).max(S::zero());
        let ratio = (v.abs() / S::from(self.film_velocity)).min(S::one()).max(S::c(SMALLEST_RATIO));
        greatest * ratio.pow(S::c(FILM_EXPONENT))
    }

    /// Returns dh/dt, 1/s.
    fn film_rate<S: Over<P>>(&self, v: S, h: S, levels: &Levels<S>) -> S {
        let missing = self.steady_film(v, levels) - h;
        let moving = S::select(
            missing.lt(S::zero()),
            S::from(P::one() / self.film_decay_time),
            S::from(P::one() / self.film_growth_time),
        );
        let ratio = v / S::from(self.film_rest_velocity);
        let resting = (-(ratio * ratio)).exp();
        missing * (moving + resting * (S::from(P::one() / self.film_rest_time) - moving))
    }

    /// Returns g(v, h), N.
    fn level<S: Over<P>>(&self, at: &At<S>, h: S, levels: &Levels<S>) -> S {
        let excess = ((S::one() - h) * levels.breakaway - levels.coulomb).max(S::zero());
        excess.fma(self.pressed_weight(at), levels.coulomb)
    }
}

impl<P: Real> Law<P> for FilmLuGre<P> {
    const KEY: &'static str = "film-lugre";
    const TITLE: &'static str = "LuGre with a lubricant film: friction that lags in sliding, too";
    const SOURCE: &'static str = "tran2013";
    const STATES: &'static [InnerState] = &[DEFLECTION, FILM];
    const DAMPED: bool = true;

    bristle_law!();

    fn inertia(&self) -> P {
        self.viscous * self.fluid_lead_time
    }

    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], _mode: P) -> S {
        let (v, h) = (at.v, z[1]);
        let elastic = S::from(self.bristle_stiffness) * z[0];
        let rate = v - v.abs() * elastic / self.level(at, h, levels);
        dz[0] = rate;
        dz[1] = self.film_rate(v, h, levels);
        self.force_of(v, levels.viscous, elastic, rate)
    }

    fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
        self.steady_at(&At { v, ..At::at_rest() }, levels)
    }

    fn steady_at<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>) -> S {
        sliding(at.v, self.level(at, self.steady_film(at.v, levels), levels), levels.viscous)
    }
}
