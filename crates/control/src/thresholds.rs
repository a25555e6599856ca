//! Thresholds of controllers, observer and supervisor: name, value, unit, meaning and reason of each, in one table.
//!
//! The controller file has the bounds that users set. The page on the theory prints [`thresholds`].

/// Name in the code, value (or values), unit, meaning and reason of a threshold. The unit is in SI, or the counted thing;
/// `1` is a pure number.
pub type Threshold = (&'static str, String, &'static str, &'static str, &'static str);

macro_rules! thresholds {
    ($($name:ident: $kind:ty = $value:expr, $unit:literal, $meaning:literal, $reason:literal;)*) => {
        $(#[doc = concat!($meaning, "; ", $unit, " (", $reason, ")")] pub(crate) const $name: $kind = $value;)*

        /// All thresholds, in the order of the code.
        pub fn thresholds() -> Vec<Threshold> {
            vec![$((stringify!($name), format!("{:?}", $name), $unit, $meaning, $reason)),*]
        }
    };
}

thresholds! {
    // Observer and model.
    OBSERVER_REST: f64 = 2e-3, "m/s", "speed below which an unexplained force is assigned to friction", "assumed";
    LONGEST_PIECE: f64 = 1e-3, "s", "longest step of the simulated motion", "short enough for spool and friction";
    FOLLOWED: f64 = 0.5, "1", "part of a step in which friction may reach its level at the earliest", "rates up to 2.7 per step are stable";
    GAS_TEMPERATURES: [f64; 2] = [100.0, 1000.0], "K", "bounds of simulated gas temperatures", "assumed";
    LEAST_PRESSURE: f64 = 1e3, "Pa", "lower bound of simulated pressures", "assumed";
    LEAST_VOLUME: f64 = 0.01, "1", "least volume of a chamber beyond the stroke, relative to its dead volume", "keeps predictions finite";
    SLOPE_STEP: f64 = 1e-4, "1", "relative change of a pressure for a numerical slope", "errors of rounding and curvature are both small";
    OVERLAP_WIDTH: f64 = 0.004, "1", "opening within which the compensation of the overlap changes sign", "assumed";
    LEAST_SPEED: f64 = 1e-12, "m/s", "speed at which the friction level of rest is evaluated", "formulas may give zero at rest";
    SMOOTH_SPEED: f64 = 1e-4, "m/s", "speed below which the direction of friction is smoothed", "assumed";
    SPOOL_ROUNDING: f64 = 1e-6, "1", "error of times from rounding, relative to a step", "far above the rounding of f64";
    LEAST_LAG: f64 = 3e-3, "s", "least lag for which a bandwidth is derived", "sensors and friction have further lags; assumed";

    // Controllers.
    LEAST_UNKNOWN: f64 = 1e-3, "1", "least unexplained force, as a fraction of the force of the supply", "a drive without friction has unexplained forces, too; assumed";
    TAKEOVER_TIME: f64 = 0.2, "s", "time in which a controller takes over, or a gain changes", "assumed";
    FARTHEST: f64 = 1e3, "m and m/s", "position and speed beyond which the observer starts again", "assumed";
    COUNT_DEVIATIONS: f64 = 3.464_101_615_137_754_6, "1", "one count of a sensor, in standard deviations of its rounding", "square root of 12: rounding is uniform";
    PUSH_BOUND: f64 = 1.5, "1", "bound of the breakaway force, in Coulomb friction", "assumed";
    PUSH_SLIPS: f64 = 0.02, "m/s", "speed above which a drive that is pushed counts as broken away", "assumed";
    NMPC_LAST: f64 = 4.0, "1", "weight of the last move, for the time after the horizon", "assumed";
    NMPC_ACCELERATION: f64 = 0.1, "1", "weight of an error of acceleration", "assumed";
    NMPC_SHORTER: f64 = 0.25, "1", "fraction of a Gauss-Newton step that is taken if the whole step increases the cost", "assumed";
    NMPC_SLOW: f64 = 0.05, "m/s", "speed below which the motion is simulated in steps of 1 ms", "assumed";
    NMPC_TRAVEL: f64 = 20.0, "1/s", "travel of the valve above which nmpc moves it less", "drives that follow as described need less; measured";
    NMPC_TRAVEL_FOR: f64 = 0.5, "s", "time over which this travel is averaged", "some periods of a swing; assumed";
    NMPC_ROUNDS: usize = 20, "1", "rounds of the search for moves at a limit", "eight moves need fewer";
    LAW_BANDWIDTH: f64 = 48.0, "rad/s", "bandwidth of pid and of the sliding surface", "assumed";
    SLIDING_GAIN: f64 = 0.1, "1", "gain as a fraction of force rate over mass", "assumed";
    STIFFNESS_WEIGHT: f64 = 0.3, "1", "weight of the stiffness beside the force", "assumed";
    STIFFNESS_RATE: f64 = 0.2, "1", "rate of the stiffness as a fraction of the bandwidth", "assumed";
    STIFFNESS_MEAN: [f64; 2] = [0.25, 0.75], "1", "mean pressures between which a stiffness is reached, from ambient (0) to supply (1)", "assumed";

    NMPC_WANDER: f64 = 0.5, "1", "random walk of the unexplained force for nmpc, relative to other controllers", "the drive swings less with a wrong mass or dry friction; measured";

    // Holding.
    HOLD_MANY: f64 = 10.0, "bands", "error above which a drive kept at rest tries to come nearer", "assumed";
    HOLD_TRIES_AFTER: f64 = 0.3, "s", "time at rest before this try", "assumed";
    HOLD_RAMP: f64 = 0.5, "s", "time in which the force of this try grows by the breakaway friction", "slow, so that a slip is short; assumed";
    HOLD_SPEED: f64 = 1e-3, "m/s", "speed below which holding may begin", "assumed";
    HOLD_SWITCHING: [f64; 2] = [3.0, 4.0], "1/s", "rates of contact and gas on switching valves", "assumed";
    HOLD_ELASTIC: [f64; 2] = [5.0, 8.0], "1/s", "rates of contact and gas for an elastic contact", "faster, the next breakaway of a light piston is larger; assumed";
    HOLD_DRIFTING: [f64; 2] = [8.0, 30.0], "1/s", "rates of contact and gas for a contact that drifts", "leakage within an unknown overlap moves the piston; assumed";
    HOLD_LEAVE: f64 = 2.5, "bands", "error at which holding ends", "assumed";
    HOLD_ROOM: [f64; 2] = [0.35, 0.7], "1", "change of the held force, in breakaway friction: elastic contact, contact that drifts", "a contact that has not slipped until then sticks; assumed";
    HOLD_FORGETS: f64 = 10.0, "s", "time in which the range of the held force follows the force", "a contact that creeps needs more and more force; assumed";
    HOLD_VAIN: f64 = 2.0, "1", "slips past the target until the drive is kept where it is", "one slip may be chance; assumed";
    HOLD_NEARER: f64 = 0.8, "1", "a slip comes nearer if its error is below this fraction of the least error", "assumed";
    HOLD_FARTHEST: f64 = 0.8e-3, "m", "distance from the beginning of holding at which holding ends and the law takes over", "slips of a drive that is kept are shorter; assumed";
    HOLD_FASTEST: f64 = 0.1, "m/s", "speed at which holding ends and the law takes over", "slips of a held drive are slower; assumed";
    HOLD_STRONGEST: f64 = 3.0, "1", "change of the gas force at which holding ends and the law takes over, in breakaway friction", "friction bears a change of twice its breakaway value; assumed";
    HOLD_NOISE: f64 = 0.02, "1", "least such change, relative to the force of the supply pressure", "a drive without friction needs changes of force, too; assumed";
    HOLD_RELEASES: f64 = 50.0, "1/s", "rate at which the force on a contact at rest is reduced", "assumed";

    // Adaptation.
    LEARN_KEPT: f64 = 0.9995, "1", "forgetting factor per sample", "assumed";
    LEARN_VARIANCE: f64 = 0.1, "1", "variance of a parameter at the start, and its upper bound", "assumed";
    LEARN_MOTION_LAG: f64 = 0.02, "s", "lag of the force balance", "assumed";
    LEARN_GAS_LAG: f64 = 0.015, "s", "lag of the energy balance", "assumed";
    LEARN_SLIDES: f64 = 0.025, "m/s", "speed above which friction is learned", "above the falling part of usual friction curves; assumed";
    LEARN_FAST: f64 = 0.05, "m/s", "speed above which friction is learned with full weight", "assumed";
    LEARN_MOVES: f64 = 5e-3, "m/s", "speed above which a drive moves in one direction", "above the noise of an estimate at rest; assumed";
    LEARN_MOVED_FOR: f64 = 0.2, "s", "time in one direction before a reversal counts", "assumed";
    LEARN_STOOD_FOR: f64 = 0.1, "s", "longest rest in a reversal that counts", "assumed";
    LEARN_REVERSAL: f64 = 0.5, "1", "weight of a reversal", "assumed";
    LEARN_SETTLED: f64 = 4.0, "lags", "time after which earlier samples have no effect", "assumed";
    LEARN_FORCE_DEVIATION: f64 = 5.0, "N", "deviation of the force balance", "assumed";
    LEARN_FLOW_DEVIATION: f64 = 0.05, "1", "deviation of the energy balance, as a fraction of the full flow", "assumed";
    LEARN_PRESSURE_DEVIATION: f64 = 6e3, "Pa", "deviation of the force balance as a pressure on the piston", "errors of pressure sensors grow with the area; assumed";
    LEARN_OFFSET: f64 = 10.0, "N", "unit of a constant force", "assumed";
    LEARN_FRICTION_WITHIN: [f64; 2] = [0.3, 3.0], "1", "bounds of learned friction, relative to the description", "assumed";
    LEARN_MASS_WITHIN: [f64; 2] = [0.5, 3.0], "1", "bounds of the learned mass, relative to the description", "assumed";
    LEARN_CONDUCTANCE_WITHIN: [f64; 2] = [0.4, 2.5], "1", "bounds of the learned conductance, relative to the description", "assumed";
    LEARN_OVERLAP_WITHIN: [f64; 2] = [0.0, 0.1], "1", "bounds of the learned overlap", "assumed";
    LEARN_BAND: [f64; 2] = [3e-3, 0.02], "s", "lags of the band in which the mass is learned: fast, slow", "drives swing at 20 to 60 Hz";
    LEARN_SWINGS: [f64; 2] = [0.1, 2.0], "1", "inertial force in this band above which the mass is learned, relative to Coulomb friction: while the reference moves, while it creeps or rests", "the inertial force of a slip is the difference between breakaway and Coulomb friction, at most twice the latter; assumed";
    LEARN_SWING_DEVIATION: f64 = 0.25, "1", "deviation of the force balance in this band, relative to Coulomb friction", "assumed";
    LEARN_OPEN: f64 = 0.012, "1", "opening beyond the overlap above which the valve is learned", "assumed";
    LEARN_SPOOL_SPEED: f64 = 5.0, "1/s", "speed of the spool below which the valve is learned", "assumed";
    LEARN_SPOOL_CALM: f64 = 0.002, "s", "time for which the spool must be slower than this speed", "assumed";
    LEARN_FULL: f64 = 0.8, "1", "pressure above which a chamber counts as full, relative to the supply", "above it, a supply that is 6 % lower fills 12 % slower; assumed";
    LEARN_JUMP: f64 = 0.5, "1", "jump of the unexplained force that counts as a load, relative to friction and inertia", "assumed";
    LEARN_WAIT: f64 = 0.5, "s", "time for which learning pauses after a load", "assumed";

    // Reference and feasibility.
    STOP_LEAST_TIME: f64 = 0.02, "s", "least time of a stop ramp", "assumed";
    RETURN_LEAST_TIME: f64 = 0.2, "s", "least time of a return to the reference", "assumed";
    FEASIBLE_STEP: f64 = 1e-3, "s", "longest step along a reference", "assumed";
    FEASIBLE_LEAST_STEP: f64 = 1e-5, "s", "shortest step along a reference", "assumed";
    FEASIBLE_PIECES: f64 = 20.0, "1", "least steps of a move", "assumed";
    FEASIBLE_SLOW: f64 = 2e-3, "m/s", "speed below which friction depends on the path only", "well above the smoothing of its direction";
    FEASIBLE_FOLLOWS: f64 = 300.0, "1/s", "rate at which the force approaches the wanted force", "well above the bandwidth of a controller; assumed";
    FEASIBLE_SLOWEST: f64 = 1e4, "1", "largest factor in time that is tried", "assumed";
    FEASIBLE_FOUND: f64 = 1e-3, "1", "relative width at which the search ends", "a reference is rounded to a thousandth";

    // Limits and reference (supervisor).
    LIMIT_ROUNDING: f64 = 1e-9, "m and m/s", "rounding error allowed for a reference at a limit", "far above the rounding of f64";
    CLOCK_WITHIN: [f64; 2] = [0.5, 1.5], "periods", "allowed time between two samples", "assumed";
    REFERENCE_JUMP: f64 = 1e-3, "m", "jump of a reference that starts a stop ramp", "assumed";
    STOP_NEAR: f64 = 2e-3, "m", "error up to which a stop ramp begins on the reference", "assumed";
    STOP_APART: f64 = 2e-3, "m", "distance from an end stop at which a stop ramp ends", "assumed";
    BLOCK_SLOW: f64 = 0.02, "m/s", "speed above which a drive with a lost sensor is stopped by a ramp before its valve is shut", "assumed";
    MODEL_TRUSTED: f64 = 0.04, "s", "time for which the position of the model is accurate without readings", "0.08 s let four drives in 2,000 hit at up to 1.3 m/s, 0.04 s none in 6,000; measured";

    // Position sensor (supervisor).
    POSITION_JUMP: f64 = 5.0, "counts", "distance from the model above which a reading is not credible; also in standard deviations of its time", "assumed";
    POSITION_STUCK: f64 = 20.0, "counts", "motion of the model, with a constant reading, above which the reading is not credible", "assumed";
    POSITION_BEARS: f64 = 2.0, "1", "force up to which friction can stop a drive or keep it at rest, relative to breakaway friction", "friction may be half described; assumed";
    POSITION_CREEPS: [f64; 2] = [5e-4, 5e-3], "m/s", "speed of the model while its drive rests: with pressure sensors, without", "the contact of the model yields smoothly below breakaway; assumed";
    POSITION_SPEED: f64 = 0.1, "1", "error of the speed of the model, relative to the highest speed", "assumed";
    POSITION_FRICTION: [f64; 2] = [2.0, 3.0], "1", "friction of the dead-reckoning model, relative to the description: with pressure sensors, without", "friction may be wrong, and is higher after a rest; assumed";
    POSITION_RETURNS: f64 = 0.3, "s", "time in which the dead-reckoning model returns to the observer", "unknown flows do not add up; assumed";
    POSITION_GONE: f64 = 2e-3, "m", "distance of the dead-reckoning model after which a constant reading counts as stuck", "assumed";
    POSITION_AT_END: f64 = 2e-3, "m", "distance from an end within which a drive may rest at its stop", "assumed";
    POSITION_LOST: u32 = 3, "samples", "readings in a row that are not credible until the sensor is lost", "assumed";

    // Pressure sensors, supply and valve (supervisor).
    PRESSURE_OFF: f64 = 0.3e5, "Pa", "distance from the model above which a pressure is not credible", "assumed";
    PRESSURE_OFF_FOR: f64 = 0.02, "s", "duration of this distance", "assumed";
    PRESSURE_FOLLOWS: f64 = 0.1, "s", "time in which the model follows the readings", "assumed";
    PRESSURE_LOST: u32 = 3, "samples", "readings in a row that are not credible until the sensor is lost", "assumed";
    GUARD_PRESSURE: [f64; 2] = [1e4, 2.0], "Pa; 1", "pressures that exported code accepts: least pressure, and greatest relative to the supply", "assumed";
    SUPPLY_FALLEN: f64 = 1e5, "Pa", "fall of the supply pressure that is reported", "assumed";
    FLOW_FORGOTTEN: f64 = 0.03, "s", "time in which a change of a pressure by flow is forgotten", "a fallen supply is reported before it matters; assumed";
    FLOW_SEEN: f64 = 0.4e5, "Pa", "change of both pressures by flow, by the model, above which the measured flows are compared with it", "assumed";
    FLOW_DIFFERS_FOR: f64 = 0.01, "s", "time after which flows that differ from the model are reported", "assumed";
    FLOW_LEAST: f64 = 0.5, "1", "relative flow of both chambers below which the valve does not react", "assumed";
    STARVED_FLOW: [f64; 2] = [0.1, 1.3], "1", "flow of a starved chamber, relative to a fallen supply: into the chamber, back into the supply", "a chamber fills at a tenth of the flow if the supply pressure sags; assumed";
    STARVED_DEFICIT: f64 = 0.12e5, "Pa", "missing pressure above which a chamber counts as starved", "assumed";

    // End-stop brake (supervisor).
    BRAKE_TOUCH: f64 = 0.03, "m/s", "speed at which the drive may touch an end stop", "assumed";
    BRAKE_SLOW: f64 = 0.1, "m/s", "speed below which the valve is shut instead of reversed", "full braking connects the chamber ahead with a supply that may have fallen; assumed";
    BRAKE_SOFT: f64 = 0.04, "m/s", "speed at which the drive may touch an end stop with the valve shut", "assumed";
    BRAKE_APART: f64 = 0.5e-3, "m", "error of the position", "assumed";
    BRAKE_STEPS: usize = 300, "samples", "longest simulation of a braking distance", "0.3 s: a drive has turned around by then";
    BRAKE_LEAST: f64 = 0.2, "1", "least braking force, relative to full pressure", "nothing is simulated if the drive is far from the end; assumed";
    BRAKE_TURN: f64 = 0.03, "s", "time in which the force of the gas turns", "assumed";
    BRAKE_GAIN: [f64; 2] = [2e-3, 6e-3], "s", "time for which the full force may act before braking: along the motion, after a turn", "assumed";
    BRAKE_AWAY: f64 = 0.03, "s", "time for which a drive that moves away from the end is simulated", "assumed";
    BRAKE_MARGINS: [f64; 2] = [0.5, 1.5], "1", "margin of the braking distance: before braking, during braking", "for errors of the model, and against chatter; assumed";

    // Motion monitor (supervisor).
    MOTION_SWING: f64 = 5.0, "tolerances", "least error of a limit cycle along a reference, peak to peak", "assumed";
    MOTION_SWINGS: u32 = 4, "1", "changes of sign of an error beyond its tolerance for each reversal of the reference, beyond which it is a limit cycle", "a reversal gives two; assumed";
    MOTION_MOVED: f64 = 1e-3, "m", "distance that counts as motion", "assumed";
    MOTION_AIR: f64 = 0.3, "1", "pressure below which the supply counts as absent, relative to the supply", "assumed";
    MOTION_HELD: f64 = 1.5, "1", "force above which something else must block the drive, relative to breakaway friction", "assumed";
}
