//! The usual form of a part.

/// Declares a part of circuits. It has numbers with one value in each lane, laws, and fields that are the same in all
/// lanes.
macro_rules! gathered {
    ($(#[$attribute:meta])* pub struct $name:ident {
        numbers { $($(#[$number_attribute:meta])* $number:ident),* $(,)? }
        laws { $($law:ident: $law_type:ident),* $(,)? }
        same { $($(#[$same_attribute:meta])* $same:ident: $same_type:ty),* $(,)? }
    }) => {
        $(#[$attribute])*
        #[derive(Clone, Debug)]
        pub struct $name<P> {
            $($(#[$number_attribute])* pub $number: P,)*
            $(pub $law: $law_type<P>,)*
            $($(#[$same_attribute])* pub $same: $same_type,)*
        }

        impl<R: math::Lane> $name<R> {
            /// Lane `i` takes the numbers of `each[i]`.
            pub fn gather(each: &[&$name<f64>]) -> Self {
                $name {
                    $($number: R::of_each(each, |own| own.$number),)*
                    $($law: $law_type::gather(&math::field(each, |part| &part.$law)),)*
                    $($same: each[0].$same.clone(),)*
                }
            }
        }
    };
}
pub(crate) use gathered;
