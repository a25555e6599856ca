//! Warnings about end stops.

use crate::circuit::Impact;

/// Kinetic energy that a cylinder with cushions absorbs at its end, J for each m2 of piston (assumed): 2 J at a bore of
/// 25 mm. Sizing uses it where neither task nor data sheet states a limit.
pub const IMPACT_ENERGY_J_M2: f64 = 4000.0;

/// Marks a finding that endangers people or the machine. Python shows such findings first and never folds them.
pub(super) const HAZARD: &str = "Hazard: ";

/// Warns about a stop so soft that supply pressure pushes the piston through the dead volume in front of it. `named`
/// are the names of the stiffness and of the dead volumes, without the chamber.
pub(crate) fn stop_warning(
    stiffness: f64,
    dead_volumes: [f64; 2],
    areas: [f64; 2],
    gauge: f64,
    named: [&str; 2],
) -> Option<String> {
    let depth = |area: f64| gauge * area / stiffness;
    let room = [dead_volumes[0] / areas[0], dead_volumes[1] / areas[1]];
    // Chamber a pushes towards the end of b, and chamber b towards the end of a.
    let (into_b, into_a) = (depth(areas[0]), depth(areas[1]));
    let (end, depth, room) = if into_b > room[1] { ("b", into_b, room[1]) } else { ("a", into_a, room[0]) };
    (depth > room).then(|| {
        format!(
            "supply pressure pushes the piston {:.3} mm into the end stop, but the dead volume of chamber {end} is only {:.3} mm long: \
             a larger {} or {}{end} keeps it off the cover",
            1e3 * depth, 1e3 * room, named[0], named[1]
        )
    })
}

fn end(impact: &Impact) -> &'static str {
    if impact.at_b { "b" } else { "a" }
}

/// Warns about impacts that compressed a stop fully. `named` is the name of its stiffness.
pub(super) fn through_warning(enough: f64, named: &str, impacts: &[Impact]) -> Option<String> {
    let through = || impacts.iter().filter(|impact| impact.through);
    let deepest = through().max_by(|a, b| a.force.total_cmp(&b.force))?;
    Some(format!(
        "the piston has pressed the end stop through and met the cover {} time(s), the hardest at the end of chamber {}, at \
         {:.4} s: {:.3} mm deep with {:.3e} N. {named} = {enough:.3e} N/m holds it, and so does the stop that \
         follows from the drive where none is given",
        through().count(),
        end(deepest),
        deepest.time,
        1e3 * deepest.depth,
        deepest.force
    ))
}

/// Warns about the hardest of these impacts if it exceeds the limit of a cylinder with this piston area.
pub(super) fn impact_warning(area: f64, impacts: &[Impact]) -> Option<String> {
    let taken = IMPACT_ENERGY_J_M2 * area;
    let beyond = impacts.iter().filter(|impact| impact.energy > taken).count();
    let hardest = impacts.iter().max_by(|a, b| a.energy.total_cmp(&b.energy)).filter(|_| beyond > 0)?;
    Some(format!(
        "{beyond} of {} impacts on the end stops are harder than a cylinder of this bore usually takes, {taken:.2} J (assumed: \
         4 mJ for each mm2 of piston; the data sheet says what yours takes). The hardest: {:.3} J at {:.3} m/s at the end \
         of chamber {}, at {:.4} s. Brake before the end, or add a shock absorber",
        impacts.len(),
        hardest.energy,
        hardest.speed,
        end(hardest),
        hardest.time
    ))
}
