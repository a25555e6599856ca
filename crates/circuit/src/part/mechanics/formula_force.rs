use crate::ground::{Common, Kind, Net, Own, Part, force_on, gathered, inputs};
use math::{Lane, Over};
use physics::written::Formula;

gathered! {
    /// A force on an axis, given by a user's formula. See [`ForceFormula`]. It may store energy or not. All of its work
    /// is therefore in a balance.
    pub struct FormulaForce {
        numbers { command }
        laws { law: Formula }
        same { axis: usize }
    }
}

impl<P: Lane> Part<P> for FormulaForce<P> {
    inputs! { command: "command", "1", physics::within(-1.0, 1.0) }

    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        let axis = &net.axis[self.axis];
        let given = [axis.x, axis.v, S::from(self.command)];
        self.law.value(|k| given[k])
    }

    force_on!(axis);

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        vec![("work", Kind::Energy)]
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, _common: &Common<P>, out: &mut [S]) {
        out[0] = self.force(net) * net.axis[self.axis].v;
    }
}
