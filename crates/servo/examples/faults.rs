//! Random runs with faults: `cargo run --release -p pneudrive-servo --example faults [RUNS [SEED [healthy]]]`. The last
//! word leaves the faults out.

#[path = "../tests/study/mod.rs"]
mod study;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;
use study::{Class, HARD, Outcome, healthy, is_lost_alone, outcome};

fn main() {
    let is_healthy = std::env::args().nth(3).is_some_and(|word| word == "healthy");
    let mut arguments = std::env::args().skip(1).map_while(|own| own.parse::<u64>().ok());
    let runs = arguments.next().unwrap_or(10_000) as u32;
    let seed = arguments.next().unwrap_or(1);
    let next = AtomicU32::new(0);
    let (sender, receiver) = channel::<(u32, Outcome, bool)>();
    let mut each: Vec<(u32, Outcome, bool)> = std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            let (next, sender) = (&next, sender.clone());
            scope.spawn(move || {
                loop {
                    let member = next.fetch_add(1, Ordering::Relaxed);
                    if member >= runs {
                        break;
                    }
                    let found = if is_healthy {
                        (member, healthy(seed, member), false)
                    } else {
                        (member, outcome(seed, member), is_lost_alone(seed, member))
                    };
                    if sender.send(found).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        receiver.iter().collect()
    });
    each.sort_by_key(|own| own.0);
    let mut table: BTreeMap<&str, ([u32; 7], f64)> = BTreeMap::new();
    for (member, own, alone) in &each {
        let group = if own.fault.contains('+') { "two faults" } else { &own.fault };
        for group in [group, "~ all"] {
            let row = table.entry(group).or_default();
            row.0[own.class as usize] += 1;
            row.0[5] += u32::from(*alone);
            row.0[6] += u32::from(own.early > 0);
            if own.class == Class::Hit {
                row.1 = row.1.max(own.speed);
            }
        }
        if matches!(own.class, Class::Hit | Class::Failed) || own.early > 0 {
            println!(
                "{member} {} {}: {:.3} m/s {:?}: {}",
                own.fault, own.law, own.speed, own.class, own.told
            );
        }
    }
    println!(
        "| fault | runs | safe | unavoidable | valve or all sensors lost | hit | failed | worst hit, m/s | lost without a supervisor | alarm before the fault |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (group, (counts, worst)) in &table {
        let all: u32 = counts[..5].iter().sum();
        let [safe, unavoidable, excused, hit, failed, alone, early] = counts;
        println!(
            "| {group} | {all} | {safe} | {unavoidable} | {excused} | {hit} | {failed} | {worst:.2} | {alone} | {early} |"
        );
    }
    println!("a hit counts from {HARD} m/s on");
}
