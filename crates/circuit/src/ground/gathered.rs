//! The usual forms of a part and of its inputs.

/// Declares a part of circuits. It has numbers with one value in each lane, laws, and fields that are the same in all
/// lanes.
macro_rules! gathered {
    ($(#[$attribute:meta])* pub struct $name:ident {
        numbers { $($(#[$number_attribute:meta])* $number:ident),* $(,)? }
        $(laws { $($law:ident: $law_type:ident),* $(,)? })?
        $(same { $($(#[$same_attribute:meta])* $same:ident: $same_type:ty),* $(,)? })?
    }) => {
        $(#[$attribute])*
        #[derive(Clone, Debug)]
        pub struct $name<P> {
            $($(#[$number_attribute])* pub $number: P,)*
            $($(pub $law: $law_type<P>,)*)?
            $($($(#[$same_attribute])* pub $same: $same_type,)*)?
        }

        math::gather!($name { $($number,)* $($($law),*)? } $(same { $($same),* })?);
    };
}
pub(crate) use gathered;

/// Inside `impl Part`: inputs that are numbers of the part, each with its name, unit and bounds.
macro_rules! inputs {
    ($($($field:ident).+: $name:literal, $unit:literal, $bounds:expr);* $(;)?) => {
        fn inputs(&self) -> &'static [$crate::ground::Input] {
            const { &[$($crate::ground::Input { name: $name, unit: $unit, bounds: $bounds }),*] }
        }
        fn input(&self, input: usize) -> P {
            [$(self.$($field).+),*][input]
        }
        fn input_mut(&mut self, input: usize) -> &mut P {
            [$(&mut self.$($field).+),*][input]
        }
    };
}
pub(crate) use inputs;

/// Inside `impl Part`: the force of the part acts on an axis in +x, and in the other direction on a second axis, if any.
macro_rules! force_on {
    ($axis:ident $(, $from:ident)?) => {
        #[inline(always)]
        fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
            let force = self.force(net);
            net.axis[self.$axis].force += force;
            $(net.axis[self.$from].force -= force;)?
        }
    };
}
pub(crate) use force_on;

/// Inside `impl Part`: the single flow path of a part.
macro_rules! one_path {
    ($path:ident) => {
        fn paths(&self) -> &[$crate::ground::Between] {
            std::slice::from_ref(&self.$path)
        }
    };
}
pub(crate) use one_path;

/// Inside `impl Part`: the first state of a part is a signal.
macro_rules! first_is_a_signal {
    ($signal:ident) => {
        #[inline(always)]
        fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
            [net.signal[self.$signal]] = y.first::<1>();
        }
    };
}
pub(crate) use first_is_a_signal;
