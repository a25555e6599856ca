//! Values of lanes from one value of each lane.

use crate::Lane;

/// A value of one lane. One of them for each lane makes a value of lanes.
pub trait Gather<R> {
    /// The same with numbers of lanes.
    type Lanes;

    /// Lane `i` takes the numbers of `each[i]`. Choices and counts are those of the first.
    fn gather(each: &[&Self]) -> Self::Lanes;
}

/// Implements [`Gather`] for a struct, from its fields with numbers, those that all lanes share, and those that a
/// function of all lanes gives.
#[macro_export]
macro_rules! gather {
    ($name:ident $([const $constant:ident: $type:ty])? { $($field:tt),* $(,)? }
        $(same { $($same:ident),* $(,)? })? $(of { $($other:ident: $of:expr),* $(,)? })?) => {
        impl<R: $crate::Lane $(, const $constant: $type)?> $crate::Gather<R> for $name<f64 $(, $constant)?> {
            type Lanes = $name<R $(, $constant)?>;

            #[inline(never)]
            fn gather(each: &[&Self]) -> Self::Lanes {
                $name {
                    $($field: $crate::Gather::gather(&$crate::field(each, |own| &own.$field)),)*
                    $($($same: each[0].$same.clone(),)*)?
                    $($($other: $of(each),)*)?
                }
            }
        }
    };
}

/// Implements `map` for a struct of numbers, of arrays of numbers and of structs with `map`, and of other values that
/// stay the same. Without the latter two, it also implements `zip`.
#[macro_export]
macro_rules! mapped {
    ($name:ident { $($number:ident),* } $(arrays { $($array:ident),* })?) => {
        $crate::mapped!($name { $($number),* } parts { $($($array),*)? } same {});

        impl<S: Copy> $name<S> {
            /// Returns the numbers that a function gives for each two numbers of the same place.
            #[allow(dead_code)]
            #[inline(always)]
            pub fn zip(&self, other: &Self, f: impl Fn(S, S) -> S) -> Self {
                $name {
                    $($number: f(self.$number, other.$number),)*
                    $($($array: std::array::from_fn(|i| f(self.$array[i], other.$array[i])),)*)?
                }
            }
        }
    };
    ($name:ident { $($number:ident),* } parts { $($part:ident),* } same { $($same:ident),* }) => {
        impl<S: Copy> $name<S> {
            /// Returns the same in other numbers.
            #[inline(always)]
            pub fn map<T>(&self, f: impl Fn(S) -> T) -> $name<T> {
                $name {
                    $($number: f(self.$number),)*
                    $($part: self.$part.map(&f),)*
                    $($same: self.$same.clone(),)*
                }
            }
        }
    };
}

/// Implements [`Gather`] for an enum, each of whose variants has one value. All lanes must have the same variant.
#[macro_export]
macro_rules! gather_enum {
    ($name:ident { $($variant:ident),* $(,)? }) => {
        impl<R: $crate::Lane> $crate::Gather<R> for $name<f64> {
            type Lanes = $name<R>;

            fn gather(each: &[&Self]) -> $name<R> {
                match each[0] {
                    $($name::$variant(_) => {
                        let each: Vec<_> = each
                            .iter()
                            .map(|own| if let $name::$variant(own) = own { own } else { panic!("lanes must share one law") })
                            .collect();
                        $name::$variant($crate::Gather::gather(&each))
                    })*
                }
            }
        }
    };
}

impl<R: Lane> Gather<R> for f64 {
    type Lanes = R;

    fn gather(each: &[&f64]) -> R {
        R::from_lanes(|lane| *each[lane])
    }
}

impl<R, T: Gather<R>> Gather<R> for Option<T> {
    type Lanes = Option<T::Lanes>;

    fn gather(each: &[&Self]) -> Self::Lanes {
        each.iter().map(|own| own.as_ref()).collect::<Option<Vec<_>>>().map(|each| T::gather(&each))
    }
}

impl<R, T: Gather<R>> Gather<R> for Box<T> {
    type Lanes = Box<T::Lanes>;

    fn gather(each: &[&Self]) -> Self::Lanes {
        Box::new(T::gather(&each.iter().map(|own| &***own).collect::<Vec<_>>()))
    }
}

impl<R, T: Gather<R>> Gather<R> for Vec<T> {
    type Lanes = Vec<T::Lanes>;

    fn gather(each: &[&Self]) -> Self::Lanes {
        let item = |i: usize| T::gather(&each.iter().map(|own| &own[i]).collect::<Vec<_>>());
        (0..each[0].len()).map(item).collect()
    }
}

impl<R, T: Gather<R>, const N: usize> Gather<R> for [T; N] {
    type Lanes = [T::Lanes; N];

    fn gather(each: &[&Self]) -> Self::Lanes {
        std::array::from_fn(|i| T::gather(&each.iter().map(|own| &own[i]).collect::<Vec<_>>()))
    }
}
