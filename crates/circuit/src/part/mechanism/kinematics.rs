//! Kinematics of a platform, without its circuit.

use crate::part::Platform;
use crate::part::mechanism::Mechanism;
use crate::part::mechanism::dynamics::{Cholesky, forms, with_square, with_sum};
use crate::part::mechanism::jet::Jet;

/// A platform at coordinates and rates.
#[derive(Clone, Debug)]
pub struct Evaluated {
    /// Position of each leg, m.
    pub positions: Vec<f64>,
    /// Velocity of each leg, m/s.
    pub velocities: Vec<f64>,
    /// Acceleration of each leg without second rates of the coordinates, m/s2.
    pub accelerations: Vec<f64>,
    /// Derivatives of the positions by the coordinates, row by row.
    pub jacobian: Vec<f64>,
    /// Mass matrix by the coordinates, row by row.
    pub mass: Vec<f64>,
    /// Forces on the coordinates by motion and gravity.
    pub forces: Vec<f64>,
    /// Origin of the platform, m, and the unit vectors of its axes.
    pub frame: [[f64; 3]; 4],
    /// Velocity of the origin and angular velocity for each coordinate rate, row by row.
    pub twist: Vec<f64>,
}

/// Steps of a search, its first damping, and the residual at which it ends, m.
const STEPS: usize = 200;
const DAMPING: f64 = 1e-3;
const CLOSED: f64 = 1e-14;

/// Largest residual of a start, m, and largest tilt, deg: beyond it the legs cross each other (assumed).
const RESIDUAL: f64 = 1e-9;
const MOST_TILT: f64 = 90.0;

/// Fault of a start.
pub(crate) enum Unreached {
    /// No pose has these positions. A leg, and its position in the nearest pose, m.
    Leg(usize, f64),
    /// The pose is singular, or tilts by this angle, deg.
    Pose(f64),
}

impl Platform<f64> {
    /// Checks the pose of these positions, m, and velocities, m/s, of the legs.
    pub(crate) fn check_start(&self, starts: &[[f64; 2]]) -> Result<(), Unreached> {
        let n = starts.len();
        let own = self.forward(starts);
        let at = self.evaluate(&own[..n], &own[n..]);
        let off = |at: &Evaluated, i: usize| (starts[i][0] - at.positions[i]).abs();
        let speed = |i: usize| (starts[i][1] - at.velocities[i]).abs();
        let upright = at.frame[3][2].clamp(-1.0, 1.0).acos().to_degrees();
        if upright < MOST_TILT && (0..n).all(|i| off(&at, i) < RESIDUAL && speed(i) < RESIDUAL) {
            return Ok(());
        }
        let x: Vec<f64> = starts.iter().map(|start| start[0]).collect();
        let (nearest, residual) = self.locate(&x, None);
        if residual < RESIDUAL {
            return Err(Unreached::Pose(if upright.is_nan() { MOST_TILT } else { upright }));
        }
        let at = self.evaluate(&nearest, &vec![0.0; n]);
        let worst = (0..n).max_by(|a, b| off(&at, *a).total_cmp(&off(&at, *b))).unwrap_or(0);
        Err(Unreached::Leg(worst, at.positions[worst]))
    }

    /// Returns the mechanism at coordinates and rates.
    pub fn evaluate(&self, q: &[f64], u: &[f64]) -> Evaluated {
        each!(self.kind, M, N => {
            let (q, u): ([f64; N], [f64; N]) = (std::array::from_fn(|k| q[k]), std::array::from_fn(|k| u[k]));
            let forms = forms::<M, f64, f64, N>(&self.geometry, &q, &u);
            // The first point is the centre of mass. For a body, the unit vectors of its axes are the third to fifth.
            let mut points: Vec<[Jet<f64, N>; 3]> = Vec::new();
            <M as Mechanism<N>>::see(&self.geometry, &Jet::coordinates(&q, &u), &mut |_: [f64; 2], x| points.push(x));
            let turns = self.kind.names().iter().any(|[name, _]| name.starts_with("tilt"));
            let (mut frame, mut twist) = ([[0.0; 3]; 4], vec![0.0; 6 * N]);
            for k in 0..3 {
                let along = |f: &dyn Fn(&Jet<f64, N>) -> f64| {
                    let offset = (0..3).map(|i| if turns { self.geometry.centre[i] * f(&points[2 + i][k]) } else { 0.0 });
                    f(&points[0][k]) - offset.sum::<f64>()
                };
                frame[0][k] = along(&|x| x.x);
                for d in 0..N {
                    twist[k * N + d] = along(&|x| x.by_q[d]);
                }
                for i in 0..3 {
                    frame[1 + i][k] = if turns { points[2 + i][k].x } else { f64::from(u8::from(i == k)) };
                }
            }
            for d in (0..N).filter(|_| turns) {
                for i in 0..3 {
                    let (r, rate) = (&frame[1 + i], [0, 1, 2].map(|k| points[2 + i][k].by_q[d]));
                    for k in 0..3 {
                        let [next, last] = [(k + 1) % 3, (k + 2) % 3];
                        twist[(3 + k) * N + d] += 0.5 * (r[next] * rate[last] - r[last] * rate[next]);
                    }
                }
            }
            let symmetric = |a: usize, b: usize| if b <= a { forms.mass[a][b] } else { forms.mass[b][a] };
            Evaluated {
                positions: forms.legs.iter().map(|leg| leg.x).collect(),
                velocities: forms.legs.iter().map(|leg| leg.v).collect(),
                accelerations: forms.legs.iter().map(|leg| leg.a).collect(),
                jacobian: forms.legs.iter().flat_map(|leg| leg.by_q).collect(),
                mass: (0..N).flat_map(|a| (0..N).map(move |b| symmetric(a, b))).collect(),
                forces: forms.forces.to_vec(),
                frame,
                twist,
            }
        })
    }

    /// Returns the coordinates at which the legs have the positions `x`, m, and the largest residual, m. The search
    /// begins at `near`, or above the frame. If no pose has these positions, the nearest one is returned.
    pub fn locate(&self, x: &[f64], near: Option<&[f64]>) -> (Vec<f64>, f64) {
        each!(self.kind, M, N => {
            let x: [f64; N] = std::array::from_fn(|k| x[k]);
            let first = near.map_or_else(
                || <M as Mechanism<N>>::near(&self.geometry, &x),
                |near| std::array::from_fn(|k| near[k]),
            );
            let legs = |q: &[f64; N]| forms::<M, f64, f64, N>(&self.geometry, q, &[0.0; N]).legs;
            let square = |legs: &[Jet<f64, N>; N]| {
                let sum: f64 = legs.iter().zip(x).map(|(leg, x)| (x - leg.x).powi(2)).sum();
                if sum.is_finite() { sum } else { f64::INFINITY }
            };
            let (mut q, mut damping) = (first, DAMPING);
            let mut now = legs(&q);
            let mut error = square(&now);
            for _ in 0..STEPS {
                let right = with_sum([0.0; N], &now, &std::array::from_fn(|i| x[i] - now[i].x));
                let mut normal = with_square([[0.0; N]; N], &now, &[1.0; N]);
                for (a, row) in normal.iter_mut().enumerate() {
                    row[a] *= 1.0 + damping;
                }
                let step = Cholesky::of(normal).solve(right);
                let trial = std::array::from_fn(|k| q[k] + step[k]);
                let next = legs(&trial);
                let after = square(&next);
                if after < error {
                    (q, now, damping) = (trial, next, if damping < 1e-12 { 0.0 } else { 0.1 * damping });
                    let is_done = error - after < CLOSED * CLOSED;
                    error = after;
                    if is_done {
                        break;
                    }
                } else if damping > 1e6 || error < CLOSED * CLOSED {
                    break;
                } else {
                    damping = (10.0 * damping).max(DAMPING);
                }
            }
            let rest = now.iter().zip(x).map(|(leg, x)| (x - leg.x).abs()).fold(0.0, f64::max);
            (q.to_vec(), if rest.is_finite() { rest } else { f64::INFINITY })
        })
    }
}
