use crate::friction::Levels;
use crate::parameter::{any, at_least};
use math::{Over, Real};

crate::parameters! {
    /// A side load on the guide of piston or rod, from mounting or load. For any law, it adds mu |N| to both levels.
    /// Source: [assumed], Coulomb friction of the guide.
    pub struct SideLoad {
        /// Force N across the axis
        force: "N", any();
        /// Coefficient of friction mu of the guide
        coefficient: "-", at_least(0.0);
    }
}

impl<P: Real> SideLoad<P> {
    #[inline(always)]
    pub(in crate::friction) fn apply<S: Over<P>>(&self, base: &Levels<S>) -> Levels<S> {
        base.plus(S::from(self.coefficient * self.force.abs()))
    }
}
