use crate::parameter::{any, within};
use crate::written::{Formula, Given, Role};

/// Output and variables of a formula of a force.
pub const FORCE: Role = Role {
    output: ("force", "N"),
    variables: &[
        Given::new("x", "m", any(), "position"),
        Given::new("v", "m/s", any(), "velocity"),
        Given::new(
            "command",
            "1",
            within(-1.0, 1.0),
            "the command, -1 to 1; a formula that uses it makes a component with a command",
        ),
    ],
    constants: &[],
};

/// Points at which a formula is checked: positions, m, velocities, m/s, commands.
const POSITIONS: [f64; 9] = [0.0, 1e-3, -1e-3, 0.02, -0.02, 0.2, -0.2, 1.0, -1.0];
const VELOCITIES: [f64; 7] = [0.0, 1e-3, -1e-3, 0.1, -0.1, 5.0, -5.0];
const COMMANDS: [f64; 3] = [0.0, 1.0, -1.0];
/// Speed after a possible jump at v = 0, m/s, a slow speed, and the fraction of the change between plus and minus that
/// counts as a jump.
const SLOWEST: f64 = 1e-10;
const SLOW: f64 = 1e-3;
const JUMP: f64 = 0.1;
/// Least force that counts as a jump, N.
const NO_JUMP: f64 = 1e-9;

/// Refuses a formula of a force, in +x on a mass, that no integrator could pass. The message names the place.
pub fn examine_force(formula: &Formula<f64>) -> Result<(), String> {
    for x in POSITIONS {
        for command in COMMANDS {
            VELOCITIES.iter().try_for_each(|v| formula.slopes(&[x, *v, command]).map(|_| ()))?;
            let force = |v: f64| formula.value(|k| [x, v, command][k]);
            let jump = |v: f64| (force(v) - force(-v)).abs();
            let (near, far) = (jump(SLOWEST), jump(SLOW));
            if near > JUMP * far && near > NO_JUMP {
                return Err(format!(
                    "formula \"{}\": the force jumps by {near:.4} N where v changes its sign (x = {x} m), which an \
                     integrator cannot pass; write tanh(v/v0) with a small v0, or give the mass a friction law \
                     that sticks",
                    formula.own.name
                ));
            }
        }
    }
    Ok(())
}
