//! Parts of a circuit: pieces with equations. A new part needs a struct in a file here, and a line in `parts!`.

pub(crate) mod flow;
pub(crate) mod gas;
mod kinds;
pub(crate) mod mechanics;
pub(crate) mod mechanism;
mod names;
pub(crate) mod valves;

pub use flow::cushion::Cushion;
pub use flow::paths::{CheckValve, Cup, Edge, FormulaPath, Gap, Poppet, TableEdge};
pub use flow::restriction::{OtherRestriction, Restriction};
pub use flow::series::{Series, TubeWall};
pub use gas::column::Column;
pub use gas::compressor::Compressor;
pub use gas::ejector::Ejector;
pub use gas::reservoir::Reservoir;
pub use gas::volume::{ChamberLaw, Volume};
pub use gas::wall::Wall;
pub(crate) use kinds::{EventId, PartKind, Parts, StoredPart};
pub use kinds::{InputId, PartId, Path};
pub use mechanics::axis::Axis;
pub use mechanics::buffers::{Bumper, Meets, ShockAbsorber};
pub use mechanics::carriage::Carriage;
pub use mechanics::couplings::{Coupling, Link, Magnet};
pub use mechanics::cylinder::{Cylinder, OtherCylinder};
pub(crate) use mechanics::end_stops::Follows;
pub use mechanics::end_stops::{Covers, EndStops};
pub use mechanics::face::{Face, PistonSide};
pub use mechanics::forces::{Along, FormulaForce, Spring, TableForce};
pub use mechanics::lock::Lock;
pub use mechanics::motor::Motor;
pub use mechanism::Platform;
pub(crate) use names::Called;
pub use valves::latch::Latch;
pub use valves::regulator::Regulator;
pub use valves::signal::{Armature, Held, SecondOrder, Spool, SpoolLeak};
