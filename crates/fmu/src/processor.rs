//! Check that this processor has the instructions that the library is compiled with.

/// Instruction sets of x86-64-v3 as CPUID reports them: leaf, register (1 = ebx, 2 = ecx) and bit.
#[cfg(target_arch = "x86_64")]
const NEEDED: [(&str, u32, usize, u32); 7] = [
    ("fma", 1, 2, 12),
    ("movbe", 1, 2, 22),
    ("avx", 1, 2, 28),
    ("f16c", 1, 2, 29),
    ("bmi1", 7, 1, 3),
    ("avx2", 7, 1, 5),
    ("bmi2", 7, 1, 8),
];

/// Returns the missing instruction sets. The argument is CPUID's answer for a leaf.
#[cfg(target_arch = "x86_64")]
fn missing(leaf: impl Fn(u32) -> [u32; 4]) -> Option<&'static str> {
    let lacks =
        |&&(_, number, register, bit): &&(&str, u32, usize, u32)| leaf(number)[register] >> bit & 1 == 0;
    NEEDED.iter().find(lacks).map(|own| own.0)
}

/// Returns an instruction set that this processor lacks, if any. The processor is queried directly, because the
/// compiler would use its assumptions about the target.
#[cfg(target_arch = "x86_64")]
#[inline(never)]
pub fn lacking() -> Option<&'static str> {
    use std::arch::x86_64::{__cpuid, __cpuid_count};
    let most = __cpuid(0).eax;
    missing(|number| {
        if number > most {
            return [0; 4];
        }
        let own = __cpuid_count(number, 0);
        [own.eax, own.ebx, own.ecx, own.edx]
    })
}

#[cfg(not(target_arch = "x86_64"))]
pub fn lacking() -> Option<&'static str> {
    None
}

/// Message for a processor without these instructions.
pub const MESSAGE: &std::ffi::CStr =
    c"pneudrive needs an x86-64-v3 processor (2013 or later): this one lacks AVX2 or FMA. \
Build the library for it from source: set target-cpu in .cargo/config.toml";

#[cfg(all(test, target_arch = "x86_64"))]
#[path = "../tests/unit/processor.rs"]
mod tests;
