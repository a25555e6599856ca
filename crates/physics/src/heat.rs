//! Heat between gas and wall.

use math::Real;

/// Heat flow from the wall into the gas, W:  Q = h A (T_wall - T).
///
/// h heat-transfer coefficient W/(m2 K); A wetted wall m2; T gas temperature K. One constant coefficient for the whole
/// wall, and a wall at constant temperature. Source: [bejan2016].
#[inline(always)]
pub fn newton<S: Real>(coefficient: S, area: S, wall_temperature: S, t: S) -> S {
    coefficient * area * (wall_temperature - t)
}
