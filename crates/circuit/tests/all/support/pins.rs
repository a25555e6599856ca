//! Results pinned to the bit: a change of the code that is to move nothing moves nothing.
//!
//! `bits.txt` holds the SHA-256 of each. Where bits move for a reason that stands in the changelog:
//!
//!     PINS=/tmp/pins cargo test -p pneudrive-circuit && sort /tmp/pins > crates/circuit/tests/all/bits.txt

use std::io::Write;

/// Holds the bits of `values` against those written down under `name`.
pub fn pinned(name: &str, values: impl IntoIterator<Item = f64>) {
    let bytes: Vec<u8> = values.into_iter().flat_map(f64::to_le_bytes).collect();
    let line = format!("{name} {}", sha256(&bytes));
    if let Ok(path) = std::env::var("PINS") {
        let file = std::fs::OpenOptions::new().create(true).append(true).open(path);
        file.and_then(|mut file| file.write_all(format!("{line}\n").as_bytes())).expect("a file for pins");
        return;
    }
    assert!(include_str!("../bits.txt").lines().any(|pin| pin == line), "moved, or not written down: {line}");
}

/// SHA-256 in hexadecimal digits. Source: FIPS 180-4.
pub fn sha256(message: &[u8]) -> String {
    let primes: Vec<u32> =
        (2..312).filter(|n| (2..*n).take_while(|d| d * d <= *n).all(|d| n % d != 0)).collect();
    // The first 32 bits of the fractions of square and cube roots: whole roots of shifted integers.
    let fraction = |prime: u32, power: u32| {
        let shifted = u128::from(prime) << (32 * power);
        let (mut low, mut high) = (0_u128, 1 << 36);
        while high - low > 1 {
            let middle = u128::midpoint(low, high);
            if middle.pow(power) <= shifted { low = middle } else { high = middle }
        }
        low as u32
    };
    let k: Vec<u32> = primes[..64].iter().map(|&prime| fraction(prime, 3)).collect();
    let mut hash: Vec<u32> = primes[..8].iter().map(|&prime| fraction(prime, 2)).collect();
    let mut padded = message.to_vec();
    padded.push(0x80);
    padded.resize((padded.len() + 8).next_multiple_of(64) - 8, 0);
    padded.extend((8 * message.len() as u64).to_be_bytes());
    for block in padded.chunks_exact(64) {
        let mut w: Vec<u32> =
            block.chunks_exact(4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]])).collect();
        for i in 16..64 {
            let (a, b) = (w[i - 15], w[i - 2]);
            let s0 = a.rotate_right(7) ^ a.rotate_right(18) ^ (a >> 3);
            let s1 = b.rotate_right(17) ^ b.rotate_right(19) ^ (b >> 10);
            w.push(w[i - 16].wrapping_add(s0).wrapping_add(w[i - 7]).wrapping_add(s1));
        }
        let mut v = hash.clone();
        for (k, w) in k.iter().zip(&w) {
            let (a, e) = (v[0], v[4]);
            let s1 = e.rotate_right(6) ^ e.rotate_right(11) ^ e.rotate_right(25);
            let choice = (e & v[5]) ^ (!e & v[6]);
            let t1 = v[7].wrapping_add(s1).wrapping_add(choice).wrapping_add(*k).wrapping_add(*w);
            let s0 = a.rotate_right(2) ^ a.rotate_right(13) ^ a.rotate_right(22);
            let majority = (a & v[1]) ^ (a & v[2]) ^ (v[1] & v[2]);
            v.rotate_right(1);
            v[0] = t1.wrapping_add(s0.wrapping_add(majority));
            v[4] = v[4].wrapping_add(t1);
        }
        for (hash, v) in hash.iter_mut().zip(v) {
            *hash = hash.wrapping_add(v);
        }
    }
    hash.iter().map(|word| format!("{word:08x}")).collect()
}
