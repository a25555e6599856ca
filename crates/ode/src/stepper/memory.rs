//! A stepper between two calls of `advance` as words, and its restoration.

use super::Stepper;
use crate::approach::Approach;
use crate::control::{Control, Statistics};
use crate::swing::SwingMemory;
use crate::system::System;

/// Words of each mass that may oscillate.
const SWING: usize = 7;

impl<Sys: System<f64>> Stepper<f64, Sys> {
    /// Returns everything that determines the further run, except inputs and modes of the system. A failed
    /// lane returns `None`.
    pub fn save(&self) -> Option<Vec<u64>> {
        let Control {
            wish,
            after_rejection,
            approach,
            cut,
            cuts,
            idle_switches,
            failure,
            statistics,
            swings,
            ..
        } = &self.lanes[0];
        if failure.is_some() {
            return None;
        }
        let Statistics { steps, rejected, right_hand_sides, jacobians, factorisations, events } = *statistics;
        let flags = [self.fresh, self.started[0], *after_rejection, cut.is_some(), approach.halving];
        let numbers = [self.t[0], *wish, cut.unwrap_or(0.0), approach.left];
        let words = numbers.iter().chain(self.state()).map(|number| number.to_bits());
        let counts = [
            steps,
            rejected,
            right_hand_sides,
            jacobians,
            factorisations,
            events,
            u64::from(*idle_switches),
            u64::from(*cuts),
            u64::from(approach.kept),
            u64::from(approach.failures),
        ];
        let swings = swings.iter().flat_map(|swing| {
            let SwingMemory { count, before, peak, turns, towards, time, resting } = swing.memory;
            [count, before, peak, turns, towards, time, resting].map(f64::to_bits)
        });
        Some(words.chain(flags.map(u64::from)).chain(counts).chain(swings).collect())
    }

    /// Returns the number of these words.
    pub fn words(&self) -> usize {
        self.structure.n + 19 + SWING * self.lanes[0].swings.len()
    }

    /// Continues, bit for bit, from the call of `save`. Inputs and modes of the system must be those of that
    /// time.
    pub fn restore(&mut self, words: &[u64]) {
        assert_eq!(words.len(), self.words(), "words of a system of this size");
        let (numbers, rest) = words.split_at(4 + self.structure.n);
        let (flags, rest) = rest.split_at(5);
        let (counts, swings) = rest.split_at(10);
        let number = |i: usize| f64::from_bits(numbers[i]);
        self.t[0] = number(0);
        for (i, y) in self.y.as_flattened_mut()[..numbers.len() - 4].iter_mut().enumerate() {
            *y = number(4 + i);
        }
        let [fresh, started, after_rejection, has_cut, halving] = [0, 1, 2, 3, 4].map(|i| flags[i] != 0);
        self.started[0] = started;
        let mut own = std::mem::take(&mut self.lanes[0].swings);
        for (swing, words) in own.iter_mut().zip(swings.as_chunks::<SWING>().0) {
            let [count, before, peak, turns, towards, time, resting] = words.map(f64::from_bits);
            swing.memory = SwingMemory { count, before, peak, turns, towards, time, resting };
        }
        self.lanes[0] = Control {
            wish: number(1),
            after_rejection,
            approach: Approach {
                left: number(3),
                halving,
                kept: counts[8] as u32,
                failures: counts[9] as u32,
            },
            cut: has_cut.then(|| number(2)),
            idle_switches: counts[6] as u32,
            cuts: counts[7] as u32,
            ..Control::new(own)
        };
        self.lanes[0].renew_share();
        self.fresh = false;
        if fresh {
            self.refresh();
        }
        self.lanes[0].statistics = Statistics {
            steps: counts[0],
            rejected: counts[1],
            right_hand_sides: counts[2],
            jacobians: counts[3],
            factorisations: counts[4],
            events: counts[5],
        };
    }
}
