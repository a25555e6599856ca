//! A component in a separate crate: a filter that clogs with the gas that has passed it.

use circuit::math::{Deps, Lane, Over, Real};
use circuit::own::{
    Between, Build, Common, Component, ComponentKind, Instance, LINEAR_ABOVE, Net, Own, OwnMut, Part, Path,
    Quantity, SUBSONIC_INDEX, State, Terminals, gas,
};
use circuit::physics::{self, flow::Iso6358};

circuit::own_part! {
    /// A flow path by ISO 6358 whose conductance falls with the mass that has passed it:
    ///
    ///   m_dot = phi(...)/(1 + m/m_half),   m' = |m_dot|                       [kg/s]
    ///
    /// m       mass that has passed                               kg
    /// m_half  mass after which half of the conductance is left   kg
    pub struct Clogging {
        numbers { half_mass }
        laws { clean: Iso6358 }
        same {
            path: Between,
            /// Index of the mass among the signals, where flow and rate read it.
            passed: usize,
        }
    }
}

impl<P: Real> Part<P> for Clogging<P> {
    fn states(&self) -> Vec<State> {
        vec![State::own("passed_mass_kg", "kg", 1e-3)]
    }

    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        let [passed] = y.first();
        net.signal[self.passed] = passed;
    }

    fn paths(&self) -> &[Between] {
        std::slice::from_ref(&self.path)
    }

    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let share = S::one() / (S::one() + net.signal[self.passed] / S::from(self.half_mass));
        self.clean.mass_flow(share, one.p, one.inverse_sqrt_t, two.p, two.inverse_sqrt_t)
    }

    fn rate<S: Over<P>>(&self, _y: Own<S>, mut dy: OwnMut<S>, net: &mut Net<S>, _common: &Common<P>) {
        dy.set([self.flow(0, net).0.abs()]);
    }
}

/// The filter as a component for users.
pub struct Filter;

impl Component for Filter {
    const KIND: ComponentKind = ComponentKind {
        key: "own/filter",
        title: "Filter that clogs",
        text: "A flow path by ISO 6358 whose conductance falls with the mass m that has passed it: C/(1 + m/m_half).",
        sources: &["iso6358-2013"],
        ports: &[gas("1"), gas("2")],
        parameters: circuit::table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of the clean filter, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.3, assumed "of a usual filter",
                "Critical pressure ratio b";
            half_mass: "kg", physics::above(0.0), "Mass m_half after which half of C is left";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        open: true,
        outputs: &[
            ("mass_flow_kg_s", "kg/s", "mass flow from port 1 to port 2"),
            ("passed_mass_kg", "kg", "mass that has passed"),
        ],
        ..ComponentKind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>)
    where
        Deps: Over<P>,
    {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let (clean, path, passed) = (own.path("conductance", build), build.between(from, to), build.signal());
        let conductance = clean.conductance;
        let part = Clogging { half_mass: own.number("half_mass"), clean, path, passed };
        let part = build.own_part(part, &[conductance]);
        build.column(own, 0, Quantity::Flow([Some(Path::along(part, 0)), None]));
        build.column(own, 1, Quantity::Signal(passed));
    }
}
