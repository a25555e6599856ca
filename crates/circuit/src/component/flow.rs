//! Components that restrict a flow.

pub(crate) mod check_valve;
pub(crate) mod fitting;
pub(crate) mod flow_control;
pub(crate) mod leak;
pub(crate) mod line;
pub(crate) mod lumped;
pub(crate) mod orifice;
pub(crate) mod quick_exhaust;
pub(crate) mod silencer;
pub(crate) mod tube;
