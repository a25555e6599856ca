use crate::ground::{Between, Net, Part, gathered, inputs, one_path};
use math::{Lane, Over};
use physics::flow::FlowFormula;

gathered! {
    /// A flow path whose mass flow is given by a user's formula. See [`FlowFormula`].
    pub struct FormulaPath {
        numbers {
            /// Fraction that a command opens.
            opening,
        }
        laws { law: FlowFormula }
        same { path: Between }
    }
}

impl<P: Lane> Part<P> for FormulaPath<P> {
    inputs! { opening: "opening", "1", physics::within(0.0, 1.0) }

    one_path!(path);

    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let m_dot = self.law.mass_flow(S::from(self.opening), [one.p, one.t], [two.p, two.t]);
        (m_dot, m_dot.lt(S::zero()))
    }
}
