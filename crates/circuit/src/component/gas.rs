//! Components that hold or deliver gas.

pub(crate) mod compressor;
pub(crate) mod ejector;
pub(crate) mod reservoir;
pub(crate) mod tank;
