//! Components whose equation is a user's formula with separate parameters.

use super::{Acts, Build, Choice, Component, Given, Instance, Kind, Row, Terminals, axis, gas};
use crate::component::Quantity;
use crate::component::instance::Written;
use crate::ground::Error;
use crate::part::{FormulaForce, FormulaPath};
use math::Lane;
use physics::IdealGas;
use physics::constants::{RHO_0, T_0};
use physics::flow::{FlowFormula, MASS_FLOW};
use physics::mechanics::{FORCE, examine_force};
use physics::written::{Formula, Known, OwnFormula, Refusal, Role, Text};

static KNOWN: Known<Written> = Known::new();

/// The formula of a component of a kind that accepts one.
pub(crate) fn written(
    base: &'static Kind,
    role: &'static Role,
    text: &Text,
) -> Result<&'static Written, Refusal> {
    if let Some(taken) = text.parameters.iter().find(|parameter| base.takes(&parameter.key)) {
        let what = format!("\"{}\" is a key of every {}", taken.key, base.key);
        let key = format!("parameters.{}", taken.key);
        return Err(Refusal::of(key, what, "Choose another name for the parameter."));
    }
    KNOWN.get(format!("{} {text:?}", base.key), || {
        let own = OwnFormula::of(role, text)?;
        let rows = own.parameters.iter().map(|parameter| Row::of(*parameter));
        let commanded = role.variables.last().is_some_and(|last| own.uses(last.name));
        let kind = Kind {
            parameters: Vec::leak(rows.collect()),
            inputs: if commanded { base.inputs } else { &[] },
            sources: if own.source.is_empty() { &[] } else { Vec::leak(vec![own.source]) },
            ..*base
        };
        Ok(Written { kind, own })
    })
}

/// Returns the formula of a component with values of its parameters.
fn valued<P: Lane>(own: &Instance<P>) -> (&'static OwnFormula, Vec<P>) {
    let Given::Formula(written) = own.extra else { unreachable!("a component with a formula") };
    (&written.own, own.numbers.iter().map(|number| number.expect("a number that was checked")).collect())
}

/// A flow path by a formula.
pub struct FormulaRestriction;

impl Component for FormulaRestriction {
    const KIND: Kind = Kind {
        key: "restriction/formula",
        title: "Flow path by a formula",
        text: "A flow path whose mass flow from the higher pressure to the lower one is your formula, with its own \
               parameters. Reverse flow follows the same formula with the ends exchanged, or is shut. Gas keeps its \
               enthalpy.",
        ports: &[gas("1"), gas("2")],
        choices: &[Choice {
            name: "backward",
            options: &["alike", "shut"],
            meaning: "Flow from port 2 to port 1: by the same formula, or none",
        }],
        formula: Some(&MASS_FLOW),
        inputs: &[("command", "1", "opening, 0 to 1")],
        outputs: &[("mass_flow_kg_s", "kg/s", "mass flow from port 1 to port 2")],
        ..Kind::PLAIN
    };

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        let (formula, values) = valued(own);
        let law = FlowFormula::new(formula, values, &IdealGas::air(), false);
        law.examine().map_err(|what| Error::Specification(format!("{}: {what}", own.name)))
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let (formula, values) = valued(own);
        let law = FlowFormula::new(formula, values, &build.gas, own.choices[0] == 1);
        // Conductance for the design of end stops: it passes the same flow from the supply when it is open.
        let [ambient, t] = [build.ambient[0], P::c(T_0)];
        let supply = build.highest.unwrap_or(ambient);
        let conductance = law.mass_flow(P::one(), [supply, t], [ambient, t]) / (supply * P::c(RHO_0));
        let path = build.circuit.between(from, to);
        let path = build.path_part(FormulaPath { opening: P::zero(), law, path }, conductance);
        if !own.table.inputs.is_empty() {
            build.input(own, 0, Acts::On(path.part.input(0)));
        }
        build.column(own, 0, Quantity::along(path));
    }
}

/// A force by a formula.
pub struct Force;

impl Component for Force {
    const KIND: Kind = Kind {
        key: "force/formula",
        title: "Force by a formula",
        text: "A force on a mass, in +x, that is your formula of position, velocity and a command, with its own \
               parameters. One account of the ledger books all its work.",
        ports: &[axis("1", false)],
        formula: Some(&FORCE),
        inputs: &[("command", "1", "command, -1 to 1")],
        outputs: &[("force_n", "N", "force in +x")],
        ..Kind::PLAIN
    };

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        let (formula, values) = valued(own);
        examine_force(&Formula::new(formula, values))
            .map_err(|what| Error::Specification(format!("{}: {what}", own.name)))
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let Some(axis) = at.axis(0) else { return };
        let (formula, values) = valued(own);
        let law = Formula::new(formula, values);
        let part = build.circuit.add(FormulaForce { command: P::zero(), law, axis: axis.0 });
        if !own.table.inputs.is_empty() {
            build.input(own, 0, Acts::On(part.input(0)));
        }
        build.column(own, 0, Quantity::Force(part));
    }
}
