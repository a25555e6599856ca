//! The tables of all kinds of component agree with what the components do.

use circuit::{Brings, Holds, Instance, KINDS};

#[test]
fn a_port_holds_what_its_component_brings() {
    for table in KINDS {
        let own = Instance::new("one", table.key, |_| Some((1.0, false)));
        for (place, port) in table.ports.iter().enumerate() {
            let holds = match own.brings(place, 293.15) {
                Brings::Volume(_) => Holds::Volume,
                Brings::Reservoir { .. } => Holds::Pressure,
                Brings::Motion => Holds::Motion,
                Brings::Mass { .. }
                | Brings::Guide { .. }
                | Brings::Along
                | Brings::Room { .. }
                | Brings::Nothing => Holds::Nothing,
            };
            let stated = if port.holds == Holds::Set { Holds::Nothing } else { port.holds };
            assert_eq!(holds, stated, "{} {}", table.key, port.name);
        }
    }
}
