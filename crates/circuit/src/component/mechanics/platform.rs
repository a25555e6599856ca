//! Platforms as components.

use crate::component::prelude::*;
use crate::component::{count, join};
use crate::ground::AxisId;
use crate::part::Platform;
use crate::part::mechanics::axis::largest_scales;
use crate::part::mechanism::{Geometry, MechanismKind};
use physics::constants::STANDARD_GRAVITY;
use physics::friction::Contact;
use physics::{Bounds, Parameter};
use std::f64::consts::{FRAC_PI_3, TAU};

const fn row(
    key: &'static str,
    within: &'static str,
    unit: &'static str,
    default: Option<f64>,
    [assumed, follows]: [&'static str; 2],
    meaning: &'static str,
) -> Row {
    let bounds: Bounds = physics::any();
    let parameter = Parameter { key, unit, bounds, default, meaning };
    Row { assumed, follows, within, ..Row::of(parameter) }
}

/// The rows of a vector of each leg, in one table for each leg.
macro_rules! vectors {
    ($what:literal, $unit:literal, $z:expr, $meaning:literal, [$($leg:literal),*]) => {
        &[$(
            row(concat!($what, "_", $leg, "_x"), concat!($what, "_", $leg), $unit, None, [""; 2], concat!($meaning, " ", $leg, ": x")),
            row(concat!($what, "_", $leg, "_y"), concat!($what, "_", $leg), $unit, None, [""; 2], concat!($meaning, " ", $leg, ": y")),
            row(concat!($what, "_", $leg, "_z"), concat!($what, "_", $leg), $unit, Some($z), ["in the plane of the circle", ""], concat!($meaning, " ", $leg, ": z")),
        )*]
    };
}

/// The rows of a number of each leg.
macro_rules! numbers {
    ($what:literal, $unit:literal, $follows:literal, $meaning:literal, [$($leg:literal),*]) => {
        &[$(row(concat!($what, "_", $leg), "", $unit, None, ["", $follows], concat!($meaning, " ", $leg)),)*]
    };
}

const CIRCLES: &[Row] = table! {
    base_radius: "m", physics::above(0.0), unless "frame_1_x", "Radius of the circle of the joints on the frame";
    platform_radius: "m", physics::above(0.0), unless "platform_1_x", "Radius of the circle of the joints on the platform";
};
const PAIRS: &[Row] = table! {
    base_angle: "rad", physics::within(0.0, FRAC_PI_3), unless "frame_1_x", "Half of the angle between the joints of a pair on the frame";
    platform_angle: "rad", physics::within(0.0, FRAC_PI_3), unless "platform_1_x", "Half of the angle between the joints of a pair on the platform; its pairs lie between those of the frame";
};
const LENGTH: &[Row] = table! {
    length: "m", physics::above(0.0), "Distance of the joints of a leg at x = 0";
};
const ARM: &[Row] = table! {
    length: "m", physics::above(0.0), "Length r of an arm";
    arm_mass: "kg", physics::at_least(0.0), default 0.0, assumed "a light arm", "Mass of an arm, a uniform rod";
};
const MASS: &[Row] = table! {
    mass: "kg", physics::above(0.0), "Mass of the platform";
    payload: "kg", physics::at_least(0.0), default 0.0, assumed "no payload", "Mass of a payload, a point";
    gravity_x: "1", physics::any(), default 0.0, "Direction of gravity in the axes of the frame: x";
    gravity_y: "1", physics::any(), default 0.0, "The same: y";
    gravity_z: "1", physics::any(), default -1.0, "The same: z";
};
const BODY: &[Row] = table! {
    inertia_x: "kg m2", physics::above(0.0), "Moment of inertia of the platform about its axis x through its centre of mass";
    inertia_y: "kg m2", physics::above(0.0), "The same about y";
    inertia_z: "kg m2", physics::above(0.0), "The same about z";
    centre_x: "m", physics::any(), default 0.0, assumed "on the axis", "Centre of mass in the axes of the platform: x";
    centre_y: "m", physics::any(), default 0.0, assumed "on the axis", "The same: y";
    centre_z: "m", physics::any(), default 0.0, assumed "in the plane of the joints", "The same: z";
    payload_at_x: "m", physics::any(), default 0.0, assumed "on the axis", "Place of the payload in the axes of the platform: x";
    payload_at_y: "m", physics::any(), default 0.0, assumed "on the axis", "The same: y";
    payload_at_z: "m", physics::any(), default 0.0, assumed "in the plane of the joints", "The same: z";
};
const LEGS: &[Row] = table! {
    rod_centre: "m", physics::any(), default 0.0, assumed "at the joint", "Distance of the centre of mass of a rod from its joint on the platform";
    barrel_mass: "kg", physics::at_least(0.0), default 0.0, assumed "a light barrel", "Mass of a barrel";
    barrel_centre: "m", physics::any(), default 0.0, assumed "at the joint", "Distance of the centre of mass of a barrel from its joint on the frame";
    leg_inertia: "kg m2", physics::at_least(0.0), default 0.0, assumed "thin and short", "Moment of inertia of a leg: barrel and rod, each about its own centre of mass";
};

const NEAR: &[Row] = table! {
    near_x: "m", physics::any(), follows "the start pose of the file, or behind the carriages", within "near", "Place near the platform at the start, of two with the same legs: x";
    near_y: "m", physics::any(), follows "the start pose of the file, or behind the carriages", within "near", "The same: y";
    near_z: "m", physics::any(), follows "the start pose of the file, or behind the carriages", within "near", "The same: z";
};

macro_rules! joined {
    ($($rows:expr),* $(,)?) => {{
        const PARTS: &[&[Row]] = &[$($rows),*];
        const ROWS: [Row; count(PARTS)] = join(PARTS);
        &ROWS
    }};
}

/// Motion of a platform: outputs of its component.
macro_rules! motion {
    ([$($name:literal $unit:literal $meaning:literal),*], [$($leg:literal),*]) => {
        &[
            $((concat!($name, "_", $unit), $unit, $meaning),)*
            $((concat!($name, "_rate_", $unit, "_s"), concat!($unit, "/s"), concat!("rate of the ", $meaning)),)*
            $((concat!($name, "_acceleration_", $unit, "_s2"), concat!($unit, "/s2"), concat!("second rate of the ", $meaning)),)*
            $((concat!("leg_", $leg, "_position_m"), "m", concat!("position of leg ", $leg)),)*
        ]
    };
}

const TEXT: &str = "A platform on legs. Its coordinates q are states, and the positions of the legs follow from them: \
    (M + J^T D J) q'' = J^T (F - D c) - h. F is the force of each leg, D the mass inside its friction, J = dx/dq, and \
    c = x'' at q'' = 0. M and h follow from the weighted points of platform, rods and barrels. ";

macro_rules! platform {
    ($(#[$attribute:meta])* $name:ident($kind:ident) = $key:literal, $title:literal, $text:expr, $rows:expr, $outputs:expr, [$($leg:literal),*]) => {
        $(#[$attribute])*
        pub struct $name;

        impl Component for $name {
            const KIND: Kind = Kind {
                key: $key,
                title: $title,
                text: $text,
                ports: &[$(axis($leg, false)),*],
                parameters: $rows,
                outputs: $outputs,
                ..Kind::PLAIN
            };

            fn bring<P: Lane>(own: &Instance<P>, _port: usize, _ambient_temperature: P) -> Brings<P> {
                Brings::Guide { mass: own.number("mass") + own.number("payload") }
            }

            fn check(own: &Instance<f64>) -> Result<(), Error> {
                check(own, MechanismKind::$kind)
            }

            fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
                compose(own, MechanismKind::$kind, at, build);
            }
        }
    };
}

platform! {
    /// Three legs with hinges at the frame.
    Platform3Rps(Rps3) = "platform/3-rps", "Platform on three legs, 3-RPS", TEXT,
    joined!(
        CIRCLES, LENGTH, MASS, BODY, LEGS,
        vectors!("frame", "m", 0.0, "Joint on the frame of leg", ["1", "2", "3"]),
        vectors!("platform", "m", 0.0, "Joint in the axes of the platform of leg", ["1", "2", "3"]),
        numbers!("hinge", "rad", "across the direction of its joint on the frame", "Angle from x to the hinge axis of leg", ["1", "2", "3"]),
        numbers!("length", "m", "length", "Distance of the joints at x = 0 of leg", ["1", "2", "3"]),
    ),
    motion!(["heave" "m" "height of the platform", "tilt_1" "rad" "tilt 2 asin(e_1) about x", "tilt_2" "rad" "tilt 2 asin(e_2) about y"], ["1", "2", "3"]),
    ["1", "2", "3"]
}
platform! {
    /// Three legs without rotation of the platform.
    Platform3Upu(Upu3) = "platform/3-upu", "Platform on three legs, 3-UPU", TEXT,
    joined!(
        CIRCLES, LENGTH, MASS, LEGS,
        vectors!("frame", "m", 0.0, "Joint on the frame of leg", ["1", "2", "3"]),
        vectors!("platform", "m", 0.0, "Joint in the axes of the platform of leg", ["1", "2", "3"]),
        numbers!("length", "m", "length", "Distance of the joints at x = 0 of leg", ["1", "2", "3"]),
    ),
    motion!(["x" "m" "place of the platform: x", "y" "m" "place of the platform: y", "z" "m" "height of the platform"], ["1", "2", "3"]),
    ["1", "2", "3"]
}
platform! {
    /// Six legs.
    Platform6Ups(Ups6) = "platform/6-ups", "Platform on six legs, 6-UPS", TEXT,
    joined!(
        CIRCLES, PAIRS, LENGTH, MASS, BODY, LEGS,
        vectors!("frame", "m", 0.0, "Joint on the frame of leg", ["1", "2", "3", "4", "5", "6"]),
        vectors!("platform", "m", 0.0, "Joint in the axes of the platform of leg", ["1", "2", "3", "4", "5", "6"]),
        numbers!("length", "m", "length", "Distance of the joints at x = 0 of leg", ["1", "2", "3", "4", "5", "6"]),
    ),
    motion!(
        [
            "x" "m" "place of the platform: x", "y" "m" "place of the platform: y", "z" "m" "height of the platform",
            "tilt_1" "rad" "tilt 2 asin(e_1) about x", "tilt_2" "rad" "tilt 2 asin(e_2) about y", "tilt_3" "rad" "turn 2 asin(e_3) about z"
        ],
        ["1", "2", "3", "4", "5", "6"]
    ),
    ["1", "2", "3", "4", "5", "6"]
}
platform! {
    /// Three carriages with arms.
    PlatformLinearDelta(LinearDelta) = "platform/linear-delta", "Platform on three carriages, linear delta", TEXT,
    joined!(
        CIRCLES, ARM, MASS,
        vectors!("frame", "m", 0.0, "Place of the carriage at x = 0 of leg", ["1", "2", "3"]),
        vectors!("platform", "m", 0.0, "Joint in the axes of the platform of leg", ["1", "2", "3"]),
        vectors!("direction", "1", 0.0, "Direction of the carriage of leg", ["1", "2", "3"]),
        numbers!("length", "m", "length", "Length of the arm of leg", ["1", "2", "3"]),
        NEAR,
    ),
    motion!(["x" "m" "place of the platform: x", "y" "m" "place of the platform: y", "z" "m" "height of the platform"], ["1", "2", "3"]),
    ["1", "2", "3"]
}

/// An axis at a prescribed velocity.
pub struct PlatformDriven;

impl Component for PlatformDriven {
    const KIND: Kind = Kind {
        key: "platform/driven",
        title: "Axis at a prescribed velocity",
        text: "A program that owns the mass moves the axis: x' = v, an input. The force F of the axis gives the impulse \
               p, p' = F, so that p/t is the mean force over a time t, and v p the work on the program. The masses of \
               cylinder and load only design the default end stops.",
        ports: &[axis("1", false)],
        inputs: &[("velocity_m_s", "m/s", "prescribed velocity")],
        outputs: &[
            ("position_m", "m", "position"),
            ("impulse_n_s", "N s", "time integral of the force"),
            ("force_n", "N", "force of the axis in +x: gas, springs, end stops and load, minus friction"),
        ],
        ..Kind::PLAIN
    };

    fn bring<P: Lane>(_own: &Instance<P>, _port: usize, _ambient_temperature: P) -> Brings<P> {
        Brings::Guide { mass: P::zero() }
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        compose(own, MechanismKind::Rail, at, build);
    }
}

fn vector<P: Lane>(own: &Instance<P>, what: &str, leg: usize) -> Option<[P; 3]> {
    let [x, y, z] = ["x", "y", "z"].map(|axis| own.given(&format!("{what}_{}_{axis}", leg + 1)));
    Some([x?, y?, z?])
}

/// Returns the place on a circle of this radius.
fn on_circle<P: Lane>(radius: P, angle: P) -> [P; 3] {
    [radius * angle.cos(), radius * angle.sin(), P::zero()]
}

/// Returns a vector of length one.
fn unit<P: Lane>([x, y, z]: [P; 3]) -> [P; 3] {
    let size = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|x| x / size)
}

/// Returns the geometry of a platform whose legs move these masses, kg.
fn geometry<P: Lane>(own: &Instance<P>, kind: MechanismKind, rods: Vec<P>) -> Geometry<P> {
    let has = |key: &str| own.table.parameters.iter().any(|row| row.key == key);
    let n = if kind == MechanismKind::Rail { 0 } else { kind.count() };
    let (third, zero) = (P::c(TAU / 3.0), P::zero());
    let number = |key: &str| if has(key) { own.number(key) } else { zero };
    let place = |what: &str, radius: &str, angle: &dyn Fn(usize) -> P| -> Vec<[P; 3]> {
        let one = |i| vector(own, what, i).unwrap_or_else(|| on_circle(own.number(radius), angle(i)));
        (0..n).map(one).collect()
    };
    let pair = |i: usize| (third * P::c((i / 2) as f64), P::c(if i.is_multiple_of(2) { -1.0 } else { 1.0 }));
    let even = |i: usize| third * P::c(i as f64);
    let base = |i: usize| if n == 3 { even(i) } else { pair(i).0 + pair(i).1 * own.number("base_angle") };
    let top = |i: usize| {
        let (middle, sign) = pair(i);
        if n == 3 { even(i) } else { middle + sign * (third * P::c(0.5) - own.number("platform_angle")) }
    };
    let frame = place("frame", "base_radius", &base);
    let platform = place("platform", "platform_radius", &top);
    let hinge = |i: usize| {
        let [x, y, _] = frame[i];
        let size = (x * x + y * y).sqrt();
        let across = || [-(y / size), x / size, zero];
        own.given(&format!("hinge_{}", i + 1)).map_or_else(across, |angle| on_circle(P::one(), angle))
    };
    let carriage = |i: usize| unit(vector(own, "direction", i).unwrap_or([zero, zero, P::one()]));
    let directions = match kind {
        MechanismKind::Rps3 => (0..n).map(hinge).collect(),
        MechanismKind::LinearDelta => (0..n).map(carriage).collect(),
        _ => Vec::new(),
    };
    let length = |i: usize| own.given(&format!("length_{}", i + 1)).unwrap_or_else(|| own.number("length"));
    let three = |of: &str| ["x", "y", "z"].map(|axis| number(&format!("{of}_{axis}")));
    let weights = ["rod_centre", "barrel_mass", "leg_inertia", "arm_mass"];
    Geometry {
        frame,
        platform,
        directions,
        lengths: (0..n).map(length).collect(),
        lift: if has("gravity_x") {
            unit(three("gravity")).map(|x| P::c(-STANDARD_GRAVITY) * x)
        } else {
            [zero; 3]
        },
        mass: if has("mass") { own.number("mass") } else { rods[0] },
        centre: three("centre"),
        inertia: three("inertia"),
        payload: number("payload"),
        payload_at: three("payload_at"),
        rods,
        rod_centre: number("rod_centre"),
        barrel: number(if has("arm_mass") { "arm_mass" } else { "barrel_mass" }),
        barrel_centre: number("barrel_centre"),
        leg_inertia: number("leg_inertia"),
        near: ["near_x", "near_y", "near_z"].map(|key| if has(key) { own.given(key) } else { None }),
        heavy_legs: weights.iter().any(|key| has(key) && (number(key).get(0) != 0.0 || own.is_free(key))),
    }
}

fn check(own: &Instance<f64>, kind: MechanismKind) -> Result<(), Error> {
    let refuse = |what: String| refuse!("{}.{what}", own.name);
    for (what, radius) in [("frame", "base_radius"), ("platform", "platform_radius")] {
        let lacks = (0..kind.count()).find(|i| vector(own, what, *i).is_none());
        if let (Some(leg), None) = (lacks, own.given(radius)) {
            return refuse!(
                "{what}_{} is missing: give the joint of each leg, or {radius} for all of them",
                leg + 1
            );
        }
    }
    let geometry = geometry(own, kind, vec![0.0; kind.count()]);
    if !geometry.lift.iter().all(|x| x.is_finite()) {
        return refuse("gravity is not a direction: it must differ from zero".into());
    }
    let [x, y, z] = geometry.inertia;
    for (axis, largest, others) in [("x", x, y + z), ("y", y, z + x), ("z", z, x + y)] {
        if largest > others {
            return refuse!(
                "inertia_{axis} = {largest} kg m2 is impossible: it must be at most the sum of the two others, {others} kg m2"
            );
        }
    }
    if let Some(i) = geometry.directions.iter().position(|d| !d.iter().all(|x| x.is_finite())) {
        let (what, why) = match kind {
            MechanismKind::Rps3 => {
                ("hinge", "its joint lies on the axis of the frame, so that no direction follows from it")
            }
            _ => ("direction", "it must differ from zero"),
        };
        return refuse!("{what}_{} is not a direction: {why}", i + 1);
    }
    if kind == MechanismKind::Rps3 {
        let d = &geometry.directions;
        let parallel = |a: [f64; 3], b: [f64; 3]| (a[0] * b[1] - a[1] * b[0]).abs() < 1e-3;
        if parallel(d[0], d[1]) && parallel(d[1], d[2]) {
            return refuse(
                "hinge_1, hinge_2 and hinge_3 are parallel: the platform could slide along them".into(),
            );
        }
    }
    Ok(())
}

fn compose<P: Lane>(own: &Instance<P>, kind: MechanismKind, at: &Terminals, build: &mut Build<P>) {
    let legs: Option<Vec<_>> = (0..kind.count()).map(|port| at.axis(port)).collect();
    let Some(axes) = legs else { return };
    let legs =
        axes.iter().map(|axis| build.legs.iter().find(|leg| leg.axis == *axis).expect("a leg").clone());
    let legs: Vec<_> = legs.collect();
    let surrounded = |contact: Contact<P>| contact.surrounded(build.ambient[1]);
    let contacts: Vec<_> = legs.iter().map(|leg| leg.friction.clone().map(surrounded)).collect();
    // A rod behind a coupling is a point of the mechanism too: its weight, and its motion across the leg.
    let behind = |axis: &AxisId| {
        let pairs = build.coupled.iter().filter(|(pair, _)| pair.contains(axis));
        let others = pairs.flat_map(|(pair, _)| pair.iter().filter(|other| *other != axis));
        others.fold(P::zero(), |sum, other| sum + build.masses[other.0].0)
    };
    let behind: Vec<P> = axes.iter().map(behind).collect();
    let mut next = 2 * kind.count();
    let inner = contacts.iter().map(|contact| {
        let first = next;
        next += contact.as_ref().map_or(0, |contact| contact.states().len());
        first
    });
    let inertia: Vec<P> =
        contacts.iter().map(|own| own.as_ref().map_or(P::zero(), |own| own.law.inertia())).collect();
    let part = Platform {
        kind,
        geometry: geometry(
            own,
            kind,
            legs.iter().zip(&behind).map(|(leg, behind)| leg.mass + *behind).collect(),
        ),
        nodes: axes.iter().map(|axis| axis.0).collect(),
        inner: inner.collect(),
        external: legs.iter().map(|leg| leg.force).collect(),
        moved: inertia.iter().zip(&behind).map(|(inertia, behind)| *inertia - *behind).collect(),
        inertia,
        largest_scales: contacts.iter().map(|own| own.as_ref().map_or(Vec::new(), largest_scales)).collect(),
        contacts,
        velocity: (kind == MechanismKind::Rail).then(P::zero),
    };
    let id = build.circuit.add(part);
    let n = kind.count();
    build.columns(own, 0, (0..3 * n).map(|k| Quantity::Pose(id, k)));
    if kind == MechanismKind::Rail {
        return build.input(own, 0, Acts::On(id.input(1)));
    }
    build.columns(own, 3 * n, axes.into_iter().map(Quantity::Position));
}
