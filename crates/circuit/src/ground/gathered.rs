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

        math::gather!($name { $($number,)* $($law),* } same { $($same),* });
    };
}
pub(crate) use gathered;
