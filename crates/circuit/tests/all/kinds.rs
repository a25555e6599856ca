//! The tables of all kinds of component agree with themselves and with what the components do.

use circuit::{Brings, Instance};
use circuit::{Holds, KINDS};

#[test]
fn each_kind_has_a_symbol_with_a_place_for_each_port_and_options_that_there_are() {
    for kind in KINDS {
        assert!(!kind.symbol.strokes.is_empty(), "{} is drawn as a box", kind.key);
        assert_eq!(kind.symbol.ports.len(), kind.ports.len(), "{}", kind.key);
        assert!(kind.symbol.ports.iter().flatten().all(|x| x.fract() == 0.0), "{}", kind.key);
        let options = kind.choices.iter().flat_map(|choice| choice.options).copied();
        let known: Vec<_> = options.chain(kind.parameters.iter().map(|row| row.key)).collect();
        assert!(kind.symbol.when.iter().all(|(option, _)| known.contains(option)), "{}", kind.key);
    }
}

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
