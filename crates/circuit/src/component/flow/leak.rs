use crate::component::prelude::*;
use crate::part::Gap;
use physics::flow::Laminar;

/// A narrow gap.
pub struct Leak;

impl Component for Leak {
    const KIND: Kind = Kind {
        key: "leak",
        title: "Leak, laminar gap",
        text: "A narrow gap through which gas leaks in both directions: m_dot = c_l (p1^2 - p2^2)/T1 with p1 the higher \
               pressure and c_l = pi D h^3/(24 mu L R), laminar flow between two walls a distance h apart. Give the gap, or \
               a measured c_l.",
        ports: &[gas("1"), gas("2")],
        parameters: table! {
            gap_height: "m", physics::above(0.0), unless "coefficient", "Height h of the gap";
            diameter: "m", physics::above(0.0), unless "coefficient", "Diameter D of the annular gap";
            length: "m", physics::above(0.0), unless "coefficient", "Length L of the gap in the direction of the flow";
            viscosity: "Pa s", physics::above(0.0), default 1.82e-5, assumed "usual for air at 20 degC",
                "Dynamic viscosity mu of the gas";
            coefficient: "kg K/(s Pa2)", physics::above(0.0), follows "gap_height, diameter, length and viscosity",
                "Measured leak coefficient c_l";
        },
        open: true,
        outputs: &[("mass_flow_kg_s", "kg/s", "mass flow from port 1 to port 2")],
        ..Kind::PLAIN
    };

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        let given = ["gap_height", "diameter", "length"].into_iter().find(|key| own.given(key).is_some());
        match given.filter(|_| own.given("coefficient").is_some()) {
            Some(key) => refuse!(
                "{}.coefficient and {}.{key} both give the size of the leak: keep one of them",
                own.name,
                own.name
            ),
            None => Ok(()),
        }
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let law = own.given("coefficient").map_or_else(
            || {
                let gap = ["diameter", "gap_height", "length"].map(|key| own.number(key));
                Laminar::of_gap(gap, own.number("viscosity"), build.gas.gas_constant)
            },
            |coefficient| Laminar { coefficient },
        );
        let path = build.circuit.between(from, to);
        let path = build.path_part(Gap { law, path }, P::zero());
        build.column(own, 0, Quantity::along(path));
    }
}
