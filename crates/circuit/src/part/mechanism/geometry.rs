//! Dimensions and masses of a mechanism, and the equations of each kind.

use crate::part::mechanism::jet::Smooth;
use crate::part::mechanism::{Mechanism, Points};
use math::Real;

/// Dimensions and masses of a mechanism. Places are in m: joints on the frame in the axes of the frame, all others in
/// the axes of the platform.
#[derive(Clone, Debug)]
pub struct Geometry<P> {
    /// Joint of each leg on the frame, or the place of its carriage at x = 0.
    pub frame: Vec<[P; 3]>,
    /// Joint of each leg on the platform.
    pub platform: Vec<[P; 3]>,
    /// Unit vector of each leg: axis of its hinge, or direction of its carriage. Empty for other legs.
    pub directions: Vec<[P; 3]>,
    /// Length of each leg at x = 0, or length of its arm, m.
    pub lengths: Vec<P>,
    /// Acceleration of gravity with the opposite sign, in the axes of the frame, m/s2.
    pub lift: [P; 3],
    /// Mass of the platform, kg, and its centre.
    pub mass: P,
    /// Centre of mass of the platform.
    pub centre: [P; 3],
    /// Moments of inertia of the platform about its axes through its centre of mass, kg m2.
    pub inertia: [P; 3],
    /// Mass of the payload, kg.
    pub payload: P,
    /// Place of the payload.
    pub payload_at: [P; 3],
    /// Mass that moves with each port, kg: rod or carriage.
    pub rods: Vec<P>,
    /// Distance of the centre of mass of a rod from its joint on the platform, m.
    pub rod_centre: P,
    /// Mass of a barrel, kg, or of an arm.
    pub barrel: P,
    /// Distance of the centre of mass of a barrel from its joint on the frame, m.
    pub barrel_centre: P,
    /// Moment of inertia of barrel and rod about their centres of mass, kg m2.
    pub leg_inertia: P,
    /// Whether barrels, arms or moments of inertia of legs are described.
    pub heavy_legs: bool,
    /// Place near the platform at the start, if described: of two poses with the same positions of the legs, the nearer.
    pub near: [Option<P>; 3],
}

math::gather!(Geometry {
    frame, platform, directions, lengths, lift, mass, centre, inertia, payload, payload_at, rods, rod_centre, barrel,
    barrel_centre, leg_inertia, near,
} same { heavy_legs });

type Vector<T> = [T; 3];

#[inline(always)]
fn dot<T: Smooth<P>, P>(a: Vector<T>, b: Vector<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the place of a joint on the platform: p + x r_1 + y r_2 + z r_3.
#[inline(always)]
fn joint<P: Real, T: Smooth<P>>(p: Vector<T>, [r1, r2, r3]: [Vector<T>; 3], [x, y, z]: [P; 3]) -> Vector<T> {
    std::array::from_fn(|k| p[k] + r1[k].by(x) + r2[k].by(y) + r3[k].by(z))
}

/// Returns the columns of the rotation with the vector part `e` of its unit quaternion.
#[inline(always)]
fn rotation<P: Real, T: Smooth<P>>(e: Vector<T>) -> [Vector<T>; 3] {
    let one = T::of(P::one());
    let [xx, yy, zz] = e.map(|e| e * e);
    let w = (one - xx - yy - zz).sqrt();
    let two = |x: T| x + x;
    [
        [one - two(yy + zz), two(e[0] * e[1] + w * e[2]), two(e[0] * e[2] - w * e[1])],
        [two(e[0] * e[1] - w * e[2]), one - two(xx + zz), two(e[1] * e[2] + w * e[0])],
        [two(e[0] * e[2] + w * e[1]), two(e[1] * e[2] - w * e[0]), one - two(xx + yy)],
    ]
}

/// Adds the points of a rigid body with its payload: its mass, and the unit vectors of its axes. The weight of the
/// first of these is (I_y + I_z - I_x)/2, the others follow cyclically.
#[inline(always)]
fn body<P: Real, T: Smooth<P>>(
    g: &Geometry<P>,
    p: Vector<T>,
    r: [Vector<T>; 3],
    point: &mut impl Points<P, T>,
) {
    point([g.mass; 2], joint(p, r, g.centre));
    point([g.payload; 2], joint(p, r, g.payload_at));
    for i in 0..3 {
        let [own, next, last] = [0, 1, 2].map(|k| g.inertia[(i + k) % 3]);
        point([P::c(0.5) * (next + last - own), P::zero()], r[i]);
    }
}

/// Returns the positions of legs of variable length, |joint - a| - length, and adds the points of their rods and
/// barrels.
#[inline(always)]
fn legs<P: Real, T: Smooth<P>, const N: usize>(
    g: &Geometry<P>,
    joints: [Vector<T>; N],
    point: &mut impl Points<P, T>,
) -> [T; N] {
    let mut i = 0..N;
    joints.map(|joint| {
        let i = i.next().unwrap_or(0);
        let d: Vector<T> = std::array::from_fn(|k| joint[k] - T::of(g.frame[i][k]));
        let length = dot(d, d).sqrt();
        let rod = [g.rods[i]; 2];
        if g.heavy_legs {
            let inverse = length.inverse();
            let n = d.map(|d| d * inverse);
            point(rod, std::array::from_fn(|k| joint[k] - n[k].by(g.rod_centre)));
            let moment = g.barrel * g.barrel_centre;
            point([moment * g.barrel_centre + g.leg_inertia, moment], n);
        } else {
            point(rod, joint);
        }
        length - T::of(g.lengths[i])
    })
}

/// Mean of one number of each leg.
fn mean<P: Real>(n: usize, of: impl Fn(usize) -> P) -> P {
    (0..n).fold(P::zero(), |sum, i| sum + of(i)) * P::c(1.0 / n as f64)
}

/// Returns the height of a platform above the frame whose legs have these lengths, from their distances at no tilt.
fn height<P: Real>(g: &Geometry<P>, x: &[P]) -> P {
    mean(x.len(), |i| {
        let (a, b, length) = (g.frame[i], g.platform[i], g.lengths[i] + x[i]);
        let [across, along] = [0, 1].map(|k| b[k] - a[k]);
        let least = P::c(0.2) * length; // far from a singular pose
        (length * length - across * across - along * along).max(least * least).sqrt() + a[2] - b[2]
    })
}

/// Three legs with a hinge at the frame and a ball joint at the platform each. Coordinates: height of the origin of
/// the platform, and the first two numbers of the vector part of the unit quaternion of its tilt T. It twists by psi about
/// its own axis z before it tilts.
///
/// Each hinge keeps its leg in a plane: h_i . (p + R b_i - a_i) = 0, R = T(e_1, e_2) R_z(psi). The axes h_i are
/// parallel to the plane x, y, so that numbers l_i with sum l_i h_i = 0 exist. Their sum of the three equations is
/// A cos psi + B sin psi + C = 0. Two linear equations for p_x and p_y remain.
pub struct Rps3;

impl Mechanism<3> for Rps3 {
    #[inline(always)]
    fn see<P: Real, T: Smooth<P>>(g: &Geometry<P>, q: &[T; 3], point: &mut impl Points<P, T>) -> [T; 3] {
        let h = [0, 1, 2].map(|i| g.directions[i]);
        let cross = |a: [P; 3], b: [P; 3]| a[0] * b[1] - a[1] * b[0];
        let mut l = [cross(h[1], h[2]), cross(h[2], h[0]), cross(h[0], h[1])];
        // Sums over the legs: l b h^T, h h^T and h h^T b, for the numbers x, y and z of b.
        let along = |of: [P; 3], k: usize| (0..3).fold(P::zero(), |sum, i| sum + l[i] * of[i] * h[i][k]);
        let by = |k: usize| [0, 1, 2].map(|i| g.platform[i][k]);
        let turn = along(by(0), 1) - along(by(1), 0);
        let sign = P::select(turn.lt(P::zero()), -P::one(), P::one());
        l = l.map(|l| l * sign);
        let along = |of: [P; 3], k: usize| (0..3).fold(P::zero(), |sum, i| sum + l[i] * of[i] * h[i][k]);
        let [alpha, beta, gamma] = [0, 1, 2].map(|k| [along(by(k), 0), along(by(k), 1)]);
        let offset = |i: usize| h[i][0] * g.frame[i][0] + h[i][1] * g.frame[i][1];
        let delta = l[0] * offset(0) + l[1] * offset(1) + l[2] * offset(2);
        let square =
            |of: [P; 3], j: usize, k: usize| (0..3).fold(P::zero(), |sum, i| sum + of[i] * h[i][j] * h[i][k]);
        let one = [P::one(); 3];
        let [xx, xy, yy] = [square(one, 0, 0), square(one, 0, 1), square(one, 1, 1)];
        let scale = P::one() / (xx * yy - xy * xy);
        let solve = |[x, y]: [P; 2]| [(yy * x - xy * y) * scale, (xx * y - xy * x) * scale];

        let zero = T::of(P::zero());
        let [t1, t2, r3] = rotation([q[1], q[2], zero]);
        let flat = |t: [T; 3], [x, y]: [P; 2]| t[0].by(x) + t[1].by(y);
        let a = flat(t1, alpha) + flat(t2, beta);
        let b = flat(t2, alpha) - flat(t1, beta);
        let c = flat(r3, gamma) - T::of(delta);
        let size = a * a + b * b;
        let rest = (size - c * c).sqrt();
        let inverse = size.inverse();
        let cosine = (b * rest - a * c) * inverse;
        let sine = zero - (b * c + a * rest) * inverse;
        let r1: [T; 3] = std::array::from_fn(|k| cosine * t1[k] + sine * t2[k]);
        let r2: [T; 3] = std::array::from_fn(|k| cosine * t2[k] - sine * t1[k]);
        let start = solve([0, 1].map(|k| (0..3).fold(P::zero(), |sum, i| sum + offset(i) * h[i][k])));
        let mut p = [T::of(start[0]), T::of(start[1]), q[0]];
        for (k, r) in [r1, r2, r3].into_iter().enumerate() {
            let [xx, xy, yy] = [square(by(k), 0, 0), square(by(k), 0, 1), square(by(k), 1, 1)];
            let [of_x, of_y] = [solve([xx, xy]), solve([xy, yy])];
            for axis in 0..2 {
                p[axis] = p[axis] - flat(r, [of_x[axis], of_y[axis]]);
            }
        }
        let r = [r1, r2, r3];
        body(g, p, r, point);
        legs(g, [0, 1, 2].map(|i| joint(p, r, g.platform[i])), point)
    }

    fn near<P: Real>(g: &Geometry<P>, x: &[P; 3]) -> [P; 3] {
        [height(g, x), P::zero(), P::zero()]
    }
}

/// Returns the place of the platform above the middle of the frame.
fn above<P: Real>(g: &Geometry<P>, x: &[P]) -> [P; 3] {
    let [across, along] = [0, 1].map(|k| mean(x.len(), |i| g.frame[i][k] - g.platform[i][k]));
    [across, along, height(g, x)]
}

/// Three legs that let the platform move without rotation. Coordinates: place of the origin of the platform.
pub struct Upu3;

impl Mechanism<3> for Upu3 {
    #[inline(always)]
    fn see<P: Real, T: Smooth<P>>(g: &Geometry<P>, q: &[T; 3], point: &mut impl Points<P, T>) -> [T; 3] {
        point([g.mass + g.payload; 2], *q);
        let at = |i: usize| std::array::from_fn(|k| q[k] + T::of(g.platform[i][k]));
        legs(g, [0, 1, 2].map(at), point)
    }

    fn near<P: Real>(g: &Geometry<P>, x: &[P; 3]) -> [P; 3] {
        above(g, x)
    }
}

/// Six legs with a universal joint at the frame and a ball joint at the platform each. Coordinates: place of the
/// origin of the platform, and the vector part of its unit quaternion.
pub struct Ups6;

impl Mechanism<6> for Ups6 {
    #[inline(always)]
    fn see<P: Real, T: Smooth<P>>(g: &Geometry<P>, q: &[T; 6], point: &mut impl Points<P, T>) -> [T; 6] {
        let [x, y, z, e1, e2, e3] = *q;
        let (p, r) = ([x, y, z], rotation([e1, e2, e3]));
        body(g, p, r, point);
        legs(g, std::array::from_fn(|i| joint(p, r, g.platform[i])), point)
    }

    fn near<P: Real>(g: &Geometry<P>, x: &[P; 6]) -> [P; 6] {
        let ([x, y, z], zero) = (above(g, x), P::zero());
        [x, y, z, zero, zero, zero]
    }
}

/// Length of the mean direction of three carriages below which they form a flat star (assumed).
const FLAT: f64 = 0.1;

/// Three carriages on straight guides, each with an arm of constant length to the platform, which does not rotate.
/// The carriage is ahead of the platform in its direction d_i. Coordinates: place of the origin of the platform.
///
///   `w = p + b_i - a_i,   x_i = d_i.w + sqrt(r^2 - |w|^2 + (d_i.w)^2)                      [m]`
///
/// An arm is a uniform rod: a sixth of its mass at each end, the rest in the middle.
pub struct LinearDelta;

impl Mechanism<3> for LinearDelta {
    #[inline(always)]
    fn see<P: Real, T: Smooth<P>>(g: &Geometry<P>, q: &[T; 3], point: &mut impl Points<P, T>) -> [T; 3] {
        let sixth = P::c(1.0 / 6.0) * g.barrel;
        point([g.mass + g.payload + P::c(3.0) * sixth; 2], *q);
        [0, 1, 2].map(|i| {
            let (a, b, d, r) = (g.frame[i], g.platform[i], g.directions[i], g.lengths[i]);
            let w: [T; 3] = std::array::from_fn(|k| q[k] + T::of(b[k] - a[k]));
            let along = w[0].by(d[0]) + w[1].by(d[1]) + w[2].by(d[2]);
            let x = along + (T::of(r * r) - dot(w, w) + along * along).sqrt();
            let carriage: [T; 3] = std::array::from_fn(|k| T::of(a[k]) + x.by(d[k]));
            point([g.rods[i] + sixth; 2], carriage);
            if g.heavy_legs {
                let middle = std::array::from_fn(|k| (carriage[k] + q[k] + T::of(b[k])).by(P::c(0.5)));
                point([P::c(4.0) * sixth; 2], middle);
            }
            x
        })
    }

    fn near<P: Real>(g: &Geometry<P>, x: &[P; 3]) -> [P; 3] {
        let middle =
            [0, 1, 2].map(|k| mean(3, |i| g.frame[i][k] + x[i] * g.directions[i][k] - g.platform[i][k]));
        // The carriages are ahead of the platform. In a flat star, it hangs below them.
        let ahead = [0, 1, 2].map(|k| mean(3, |i| g.directions[i][k]));
        let size = (ahead[0] * ahead[0] + ahead[1] * ahead[1] + ahead[2] * ahead[2]).sqrt();
        let is_flat = size.lt(P::c(FLAT));
        let arm = P::c(0.7) * mean(3, |i| g.lengths[i]);
        let down = [P::zero(), P::zero(), P::one()];
        std::array::from_fn(|k| {
            let behind = P::select(is_flat, down[k], ahead[k] / size.max(P::c(FLAT)));
            g.near[k].unwrap_or(middle[k] - arm * behind)
        })
    }
}

/// One axis at a prescribed velocity: `PlatformDriven`. Coordinate: its position.
pub struct Rail;

impl Mechanism<1> for Rail {
    fn see<P: Real, T: Smooth<P>>(g: &Geometry<P>, q: &[T; 1], point: &mut impl Points<P, T>) -> [T; 1] {
        let zero = T::of(P::zero());
        point([g.mass, P::zero()], [q[0], zero, zero]);
        *q
    }

    fn near<P: Real>(_g: &Geometry<P>, x: &[P; 1]) -> [P; 1] {
        *x
    }
}
