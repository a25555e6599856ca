// Operations per second in f64 of a core of this machine: independent chains of fused multiply-adds, counted as two.
use std::{hint::black_box, time::Instant};

/// Numbers that are worked on side by side: eight registers of 512 bits, sixteen of 256.
const N: usize = 64;

#[inline(never)]
fn spin(all: &mut [f64; N], b: f64, c: f64, rounds: usize) {
    let mut own = *all;
    for _ in 0..rounds {
        for one in &mut own {
            *one = one.mul_add(b, c);
        }
    }
    *all = own;
}

fn main() {
    let (mut all, rounds, mut best) = ([1.0; N], 2_000_000, f64::MAX);
    for _ in 0..9 {
        let begun = Instant::now();
        spin(&mut all, black_box(0.999), black_box(1e-3), rounds);
        best = best.min(begun.elapsed().as_secs_f64());
        black_box(&mut all);
    }
    println!("{}", 2.0 * (N * rounds) as f64 / best);
}
