//! Parts that restrict a flow.

pub(crate) mod check_valve;
pub(crate) mod cup;
pub(crate) mod cushion;
pub(crate) mod edge;
pub(crate) mod formula_path;
pub(crate) mod gap;
pub(crate) mod restriction;
pub(crate) mod series;
pub(crate) mod table_edge;
