use crate::ground::{Common, Net, Own, Part, gathered};
use math::{Lane, Over};

gathered! {
    /// A spring between an axis and the ground: F = -k (x - x_rest).
    pub struct Spring {
        numbers { stiffness, rest_position }
        same { axis: usize }
    }
}

impl<P: Lane> Part<P> for Spring<P> {
    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        let node = &mut net.axis[self.axis];
        node.force -= S::from(self.stiffness) * (node.x - S::from(self.rest_position));
    }

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        let stretch = net.axis[self.axis].x - S::from(self.rest_position);
        [S::zero(), S::c(0.5) * S::from(self.stiffness) * stretch * stretch, S::zero()]
    }
}
