use super::bristles::{DEFLECTION, bristle_law, bristle_parameters};
use super::{At, InnerState, Law, Levels};
use math::{Over, Real};

bristle_parameters! {
    /// LuGre: friction as the mean deflection z of elastic bristles.
    ///
    ///   `dz/dt = v - sigma0 |v| z / g(v),    g(v) = Fc + (Fs - Fc) exp(-|v/vs|^n)`
    ///   `F = sigma0 z + sigma1(v) dz/dt + Fv v                          [N], opposes v > 0`
    ///   sigma1(v) = sigma1 exp(-(v/vd)^2), constant where no vd is given
    ///
    /// Presliding, breakaway that falls with the rate of force, frictional lag, stick-slip. It drifts under a load that
    /// oscillates below Fs. `elasto-plastic` does not. Passive if Fv >= sigma1 (Fs - Fc)/Fc, or with a fade if sigma1
    /// vd/sqrt(2 e) <= 4 Fc. Source: [canudas1995]; passivity: [barabanov2000].
    pub struct LuGre {
    }
}

impl<P: Real> Law<P> for LuGre<P> {
    const KEY: &'static str = "lugre";
    const TITLE: &'static str = "LuGre bristle model";
    const SOURCE: &'static str = "canudas1995";
    const STATES: &'static [InnerState] = &[DEFLECTION];
    const BRISTLES: bool = true;
    const DAMPED: bool = true;

    bristle_law!();

    #[inline(always)]
    fn prepare<S: Over<P>>(&self, v: S) -> S {
        self.weight(v)
    }

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], _mode: P) -> S {
        let v = at.v;
        let elastic = S::from(self.bristle_stiffness) * z[0];
        let rate = v - v.abs() * elastic / levels.at(at.prepared);
        dz[0] = rate;
        self.force_of(v, levels.viscous, elastic, rate)
    }
}
