//! What was written is read to the bit, and no bytes make the reader stumble.

use parquet::{Plain, ROWS_OF_A_GROUP, write};
use std::fs;
use std::path::PathBuf;

/// A file of its own, removed at the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str, bytes: &[u8]) -> Self {
        let path = std::env::temp_dir().join(format!("pneudrive-plain-{}-{name}", std::process::id()));
        fs::write(&path, bytes).expect("written");
        Scratch(path)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

fn table(rows: usize) -> (Vec<f64>, Vec<f64>, Vec<u8>) {
    let times: Vec<f64> = (0..rows).map(|k| k as f64 / 1e3).collect();
    let odd: Vec<f64> = (0..rows).map(|k| [f64::NAN, -0.0, f64::INFINITY, 5e-324, k as f64][k % 5]).collect();
    let mut bytes = Vec::new();
    write(&mut bytes, &[("time_s", &times), ("Kraft µN", &odd)], &[("key", "text")]).expect("written");
    (times, odd, bytes)
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn rows_come_back_across_groups() {
    let rows = 2 * ROWS_OF_A_GROUP + 3;
    let (times, odd, bytes) = table(rows);
    let scratch = Scratch::new("rows", &bytes);
    let mut file = Plain::open(&scratch.0).expect("opens").expect("is plain");
    for (begin, end) in
        [(0, rows), (5, 6), (ROWS_OF_A_GROUP - 1, 2 * ROWS_OF_A_GROUP + 1), (rows - 1, usize::MAX)]
    {
        for (name, values) in [("Kraft µN", &odd), ("time_s", &times)] {
            let read = file.read(name, begin, end).expect("reads").expect("is plain");
            assert_eq!(bits(&read), bits(&values[begin..end.min(rows)]), "{name} {begin}..{end}");
        }
    }
    assert!(file.read("time_s", rows, rows + 9).expect("reads").expect("is plain").is_empty());
    assert!(file.read("time", 0, 1).expect("reads").is_none());
}

#[test]
fn a_damaged_file_is_none_or_has_no_more_rows_than_room() {
    let (_, _, bytes) = table(20);
    let most = bytes.len() / 8;
    for place in 0..bytes.len() {
        for flip in [0x01, 0x80, 0xFF] {
            let mut damaged = bytes.clone();
            damaged[place] ^= flip;
            let scratch = Scratch::new("damaged", &damaged);
            let Ok(Some(mut file)) = Plain::open(&scratch.0) else { continue };
            if let Ok(Some(values)) = file.read("time_s", 0, usize::MAX) {
                assert!(values.len() <= most, "byte {place}: {} values", values.len());
            }
        }
    }
    for length in 0..bytes.len() {
        let scratch = Scratch::new("short", &bytes[..length]);
        assert!(matches!(Plain::open(&scratch.0), Ok(None)), "{length} bytes");
    }
}
