//! Parts that hold or deliver gas.

pub(crate) mod column;
pub(crate) mod compressor;
pub(crate) mod ejector;
pub(crate) mod reservoir;
pub(crate) mod volume;
pub(crate) mod wall;
