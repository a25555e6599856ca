//! Each operation on numbers side by side has the bits of that on `f64`, lane by lane, on the widest registers too.

use math::{Lane, Lanes, Real, Task, Work, has_eight, with_eight};

/// Numbers of every size and sign, with the special ones.
fn numbers() -> Vec<f64> {
    let special = [0.0, -0.0, 1.0, -1.0, f64::MIN_POSITIVE, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
    let spread = (1..120).map(|k| {
        let size = 10_f64.powi(k % 24 - 12) * (1.0 + 0.618_034 * f64::from(k)).fract();
        if k % 3 == 0 { -size } else { size }
    });
    special.into_iter().chain(spread).collect()
}

/// What every operation makes of three numbers.
fn results<S: Real>(a: S, b: S, c: S) -> Vec<S> {
    let (mut sum, mut product) = (a, a);
    sum += b;
    product *= b;
    let size = a.abs() + S::c(1e-3);
    let elementary = [a.exp(), size.ln(), size.pow(b.min(S::c(3.0))), a.sin(), a.cos(), a.tanh()];
    let chosen = [S::select(a.lt(b), a, c), a.max(b), a.min(b), a.abs(), -a];
    let plain = [a + b, a - b, a * b, a / b, a.fma(b, c), size.sqrt(), sum, product, a.fma_c(0.1, c)];
    [&plain[..], &elementary, &chosen].concat()
}

struct Results<R>(R, R, R);

impl<R: Lane> Work for Results<R> {
    type Out = Vec<R>;
    #[inline(always)]
    fn work(self) -> Vec<R> {
        results(self.0, self.1, self.2)
    }
}

struct Compare;

impl Task for Compare {
    type Out = usize;
    fn run<R: Lane<Plain = R>>(self) -> usize {
        let each = numbers();
        let pick = |k: usize| each[k % each.len()];
        for first in 0..each.len() {
            let triple =
                |lane: usize| [pick(first + lane), pick(3 * first + 5 * lane + 1), pick(first + 7 * lane)];
            let [a, b, c] = [0, 1, 2].map(|i| R::from_lanes(|lane| triple(lane)[i]));
            let inside = R::within(Results(a, b, c));
            for (k, (outside, inside)) in results(a, b, c).iter().zip(&inside).enumerate() {
                for lane in 0..R::L {
                    let [a, b, c] = triple(lane);
                    let alone = results(a, b, c)[k];
                    for own in [outside.get(lane), inside.get(lane)] {
                        let equal = own.to_bits() == alone.to_bits() || (own.is_nan() && alone.is_nan());
                        assert!(equal, "operation {k} of {a:e}, {b:e}, {c:e}: {own:e}, not {alone:e}");
                    }
                }
            }
            let mut changed = a;
            changed.put(first % R::L, 42.0);
            for lane in 0..R::L {
                let own = if lane == first % R::L { 42.0 } else { triple(lane)[0] };
                assert_eq!(changed.get(lane).to_bits(), own.to_bits());
            }
            let less = (0..R::L).fold(0, |bits, lane| {
                let [a, b, _] = triple(lane);
                bits | u64::from(a < b) << lane
            });
            assert_eq!(R::mask_bits(a.lt(b)), less);
            assert_eq!(R::mask_bits(R::mask_of(less)), less);
        }
        R::L
    }
}

#[test]
fn lanes_have_the_bits_of_single_numbers() {
    #[cfg(target_feature = "avx2")]
    assert_eq!(Compare.run::<math::V4>(), 4);
    assert_eq!(Compare.run::<Lanes<2>>(), 2);
    if has_eight() {
        assert_eq!(with_eight(Compare), 8);
    } else {
        println!("eight numbers at once were not tried: this processor does not have AVX-512");
    }
}
