//! Private functions of `approach.rs`.

use super::{Approach, FREE_FAILURES};

#[test]
fn a_kink_is_found_by_halving_once_many_attempts_have_failed() {
    let mut approach = Approach::NEW;
    assert_eq!((approach.failed(1.0), approach.kept(0.1, 1e-6)), (None, None));
    approach.failures = FREE_FAILURES;
    assert_eq!((approach.failed(1.0), approach.kept(0.25, 1e-6)), (None, Some(0.375)));
    assert_eq!((approach.failed(0.375), approach.kept(0.1875, 0.2)), (Some(0.5), None));
    assert_eq!(approach.failed(0.5), None);
}

#[test]
fn a_kink_passed_unnoticed_is_not_sought_for_long() {
    let mut approach = Approach { failures: FREE_FAILURES, ..Approach::NEW };
    approach.failed(1.0);
    let steps = std::iter::successors(Some(0.5), |h| approach.kept(*h, 1e-6)).count();
    assert_eq!(steps, 5);
}
