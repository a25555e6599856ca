//! Four or eight `f64` in one register of the target processor.
//!
//! Every operation is one instruction, or a sequence of instructions, that IEEE 754 rounds like the operation on `f64`.
//! The bits are therefore those of `f64`. With a plain array, the compiler may vectorise the wrong one of two indices.

// Each intrinsic needs a processor that supports it. `V4` exists only if the whole build requires such a processor.
// `V8` has no public name, and `with_eight` provides it after a check of the processor.
#![allow(unsafe_code)]

use crate::elementary::{self, Bits};
use crate::real::{Lane, Real, Task, Work, functions};
use core::arch::x86_64::*;

macro_rules! register {
    (
        $(#[$attribute:meta])* $name:ident, $n:literal, $register:ty, $integer:ty, mask $mask:ty;
        $add:ident $sub:ident $mul:ident $div:ident $xor:ident $set:ident $fma:ident $sqrt:ident;
        $set_word:ident $add_word:ident $sub_word:ident $shift_right:ident $shift_left:ident
        $to_word:ident $of_word:ident;
        less $less:expr; choose $choose:expr; bits $bits:expr; of_bits $of_bits:expr;
        general $general:literal; lane { $($lane:item)* }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug)]
        pub struct $name($register);

        $crate::operators! {
            [] $name, |a, b|
            +: $name(unsafe { $add(a.0, b.0) }),
            -: $name(unsafe { $sub(a.0, b.0) }),
            *: $name(unsafe { $mul(a.0, b.0) }),
            /: $name(unsafe { $div(a.0, b.0) }),
            neg: $name(unsafe { $xor(a.0, $set(-0.0)) }),
        }

        impl From<[f64; $n]> for $name {
            #[inline(always)]
            fn from(numbers: [f64; $n]) -> Self {
                // Both have the same number of doubles.
                $name(unsafe { std::mem::transmute::<[f64; $n], $register>(numbers) })
            }
        }

        impl $name {
            #[inline(always)]
            fn array(self) -> [f64; $n] {
                // Both have the same number of doubles.
                unsafe { std::mem::transmute::<$register, [f64; $n]>(self.0) }
            }

            #[inline(always)]
            fn map(self, f: impl Fn(f64) -> f64) -> Self {
                let mut numbers = self.array();
                for number in &mut numbers {
                    *number = f(*number);
                }
                numbers.into()
            }
        }

        impl Bits for $name {
            type Word = $integer;
            #[inline(always)]
            fn word(self) -> $integer {
                unsafe { $to_word(self.0) }
            }
            #[inline(always)]
            fn plus(word: $integer, n: u64) -> $integer {
                unsafe { $add_word(word, $set_word(n.cast_signed())) }
            }
            #[inline(always)]
            fn halves(word: $integer) -> [$integer; 2] {
                let half = unsafe { $shift_right::<1>(word) };
                [half, unsafe { $sub_word(word, half) }]
            }
            #[inline(always)]
            fn power_of_two(biased: $integer) -> Self {
                $name(unsafe { $of_word($shift_left::<52>(biased)) })
            }
        }

        impl Real for $name {
            type Mask = $mask;

            const GENERAL: bool = $general;

            #[inline(always)]
            fn c(x: f64) -> Self {
                $name(unsafe { $set(x) })
            }
            #[inline(always)]
            fn fma(self, a: Self, b: Self) -> Self {
                $name(unsafe { $fma(self.0, a.0, b.0) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $name(unsafe { $sqrt(self.0) })
            }
            functions!(call elementary: exp);
            functions!(map elementary: ln sin cos tanh);
            #[inline(always)]
            fn pow(self, exponent: Self) -> Self {
                let (mut numbers, exponents) = (self.array(), exponent.array());
                for (number, exponent) in numbers.iter_mut().zip(exponents) {
                    *number = elementary::pow(*number, exponent);
                }
                numbers.into()
            }
            #[inline(always)]
            fn lt(self, other: Self) -> $mask {
                let less: fn($register, $register) -> $mask = $less;
                less(self.0, other.0)
            }
            #[inline(always)]
            fn select(mask: $mask, a: Self, b: Self) -> Self {
                let choose: fn($mask, $register, $register) -> $register = $choose;
                $name(choose(mask, a.0, b.0))
            }
        }

        impl Lane for $name {
            type Plain = Self;
            const L: usize = $n;
            $($lane)*
            #[inline(always)]
            fn plain(&self) -> Self {
                *self
            }
            #[inline(always)]
            fn mask_bits(mask: $mask) -> u64 {
                let bits: fn($mask) -> u64 = $bits;
                bits(mask)
            }
            #[inline(always)]
            fn mask_of(bits: u64) -> $mask {
                let of: fn(u64) -> $mask = $of_bits;
                of(bits)
            }
            #[inline(always)]
            fn from_lanes(f: impl Fn(usize) -> f64) -> Self {
                let mut numbers = [0.0; $n];
                for (lane, number) in numbers.iter_mut().enumerate() {
                    *number = f(lane);
                }
                numbers.into()
            }
            #[inline(always)]
            fn get(&self, lane: usize) -> f64 {
                assert!(lane < $n);
                // Both have the same number of doubles. Reading one number in place does not load all of them.
                unsafe { std::ptr::from_ref(self).cast::<f64>().add(lane).read() }
            }
            #[inline(always)]
            fn put(&mut self, lane: usize, value: f64) {
                assert!(lane < $n);
                // As above.
                unsafe { std::ptr::from_mut(self).cast::<f64>().add(lane).write(value) }
            }
        }
    };
}

register! {
    /// Four numbers in a register of AVX2.
    V4, 4, __m256d, __m256i, mask __m256d;
    _mm256_add_pd _mm256_sub_pd _mm256_mul_pd _mm256_div_pd _mm256_xor_pd _mm256_set1_pd _mm256_fmadd_pd _mm256_sqrt_pd;
    _mm256_set1_epi64x _mm256_add_epi64 _mm256_sub_epi64 _mm256_srli_epi64 _mm256_slli_epi64
    _mm256_castpd_si256 _mm256_castsi256_pd;
    less |a, b| unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(a, b) };
    choose |mask, a, b| unsafe { _mm256_blendv_pd(b, a, mask) };
    bits |mask| unsafe { _mm256_movemask_pd(mask) as u64 };
    of_bits |bits| {
        let of = |lane: u32| if bits >> lane & 1 == 1 { -1.0 } else { 0.0 };
        unsafe { _mm256_setr_pd(of(0), of(1), of(2), of(3)) }
    };
    general true; lane {}
}

register! {
    /// Eight numbers in a register of AVX-512.
    V8, 8, __m512d, __m512i, mask __mmask8;
    _mm512_add_pd _mm512_sub_pd _mm512_mul_pd _mm512_div_pd _mm512_xor_pd _mm512_set1_pd _mm512_fmadd_pd _mm512_sqrt_pd;
    _mm512_set1_epi64 _mm512_add_epi64 _mm512_sub_epi64 _mm512_srli_epi64 _mm512_slli_epi64
    _mm512_castpd_si512 _mm512_castsi512_pd;
    less |a, b| unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b) };
    choose |mask, a, b| unsafe { _mm512_mask_blend_pd(mask, b, a) };
    bits |mask| u64::from(mask);
    of_bits |bits| bits as u8;
    general false; lane {
        #[inline(always)]
        fn within<W: Work>(work: W) -> W::Out {
            #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
            fn wide<W: Work>(work: W) -> W::Out {
                work.work()
            }
            // Callers can get this type only from `with_eight`.
            unsafe { wide(work) }
        }
    }
}

/// Returns whether this processor has registers of eight numbers.
pub fn has_eight() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}

/// Runs a task on eight numbers at once.
///
/// # Panics
///
/// For processors without registers of eight: see [`has_eight`].
pub fn with_eight<T: Task>(task: T) -> T::Out {
    assert!(has_eight(), "this processor has no registers of eight numbers");
    task.run::<V8>()
}
