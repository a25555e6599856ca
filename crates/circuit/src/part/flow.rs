//! Parts that restrict a flow.

pub(crate) mod cushion;
pub(crate) mod paths;
pub(crate) mod restriction;
pub(crate) mod series;
