//! A controller in a separate crate: feed-forward of the velocity with feedback of position and velocity.

use control::{OwnLaw, Reference, Seen};

/// u = v_d(t + lag)/K_v + k_p (x_d - x) + k_v (v_d - v)
#[derive(Clone, Copy, Debug)]
pub struct Follow {
    /// Speed at full opening K_v, m/s.
    pub speed: f64,
    /// Delay of a command, s.
    pub lag: f64,
    /// k_p, 1/m, and k_v, s/m.
    pub gains: [f64; 2],
}

impl OwnLaw for Follow {
    fn step(&mut self, seen: &Seen, reference: &Reference) -> f64 {
        let (now, later) = (reference.at(seen.time), reference.at(seen.time + self.lag));
        let [by_position, by_velocity] = self.gains;
        later.velocity / self.speed
            + by_position * (now.position - seen.position)
            + by_velocity * (now.velocity - seen.velocity)
    }
}
