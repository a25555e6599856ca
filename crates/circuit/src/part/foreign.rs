//! Parts of other crates, stored as objects: a circuit uses only their trait.

use crate::ground::{Between, Common, Given, Input, Kind, Net, Own, OwnMut, Part, State};
use math::{Deps, Dual, Lane, Lanes, Over, Real};
use std::any::{Any, TypeId};
use std::fmt::Debug;
use std::marker::PhantomData;

/// A part as a struct over every scalar type. [`own_part!`](crate::own_part) makes such a struct.
pub trait Family: 'static {
    /// The part with numbers of a type.
    type Of<R: Lane>: Part<R> + Clone + Debug + Send + Sync + 'static;

    /// Makes the part of lanes from one part for each lane.
    fn gather<R: Lane>(each: &[&Self::Of<f64>]) -> Self::Of<R>;
}

/// A struct of a family.
pub trait Member {
    /// Its scalar.
    type Family: Family;
}

/// Directions of the derivatives that the integrator takes of a right-hand side.
type Seeded<R> = Dual<R, { ode::DIRECTIONS }>;

/// A part of another crate. It supports the scalar types of an integrator and a linearisation: its numbers, duals of
/// them, and dependencies.
#[derive(Debug)]
pub struct Foreign<P> {
    part: Box<dyn Object<P>>,
    runs: Runs,
    family: &'static dyn Gathers,
}

impl<P> Clone for Foreign<P> {
    fn clone(&self) -> Self {
        Foreign { part: self.part.copy(), ..*self }
    }
}

impl<P: Lane> Foreign<P> {
    /// Returns a part during composition.
    pub(crate) fn new<T: Member + Part<P> + 'static>(part: T) -> Self
    where
        Deps: Over<P>,
        T::Family: Family<Of<P> = T>,
    {
        let mut foreign = Foreign::gathered::<T::Family>(part);
        foreign.runs[2] = Some(at::<P, Deps, T>());
        foreign
    }

    /// Returns a part of numbers for which the pattern of the equations is already known.
    fn gathered<F: Family>(part: F::Of<P>) -> Self {
        let runs = [Some(at::<P, P, F::Of<P>>()), Some(at::<P, Seeded<P>, F::Of<P>>()), None];
        Foreign { part: Box::new(part), runs, family: const { &OfType::<F>(PhantomData) } }
    }

    /// Lane `i` takes the numbers of `each[i]`.
    pub(crate) fn gather(each: &[&Foreign<f64>]) -> Self {
        let parts: Vec<&dyn Any> = each.iter().map(|foreign| foreign.part.any()).collect();
        let made = each[0].family.gather(TypeId::of::<Self>(), &parts);
        *made.downcast().expect("a part of another crate is gathered only to its own type")
    }
}

impl<P: Real> Foreign<P> {
    /// Functions of the part for one scalar type.
    #[inline]
    fn over<S: Over<P>>(&self) -> (&'static dyn Run<P, S>, &dyn Any) {
        let found = self.runs.iter().flatten().find_map(|one| one.downcast_ref::<At<P, S>>());
        (found.expect("a scalar that circuits run over").0, self.part.any())
    }
}

/// The scalar types of a part, each as an [`At`].
type Runs = [Option<&'static (dyn Any + Send + Sync)>; 3];

/// The functions of a part with numbers `P`, for the scalar type `S`.
struct At<P: 'static, S: 'static>(&'static dyn Run<P, S>);

fn at<P: Real, S: Over<P>, T: Part<P> + 'static>() -> &'static (dyn Any + Send + Sync) {
    const { &At::<P, S>(&OfType::<T>(PhantomData)) }
}

/// A marker for a type.
struct OfType<T>(PhantomData<fn() -> T>);

impl<T> Debug for OfType<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(std::any::type_name::<T>())
    }
}

trait Gathers: Debug + Send + Sync {
    /// Returns a part of the requested type: of lanes, or of numbers with derivatives.
    fn gather(&self, to: TypeId, each: &[&dyn Any]) -> Box<dyn Any>;
}

impl<F: Family> Gathers for OfType<F> {
    fn gather(&self, to: TypeId, each: &[&dyn Any]) -> Box<dyn Any> {
        let each: Vec<_> = each.iter().map(|part| of::<F::Of<f64>>(*part)).collect();
        macro_rules! to {
            ($($number:ty),*) => {
                $(if to == TypeId::of::<Foreign<$number>>() {
                    return Box::new(Foreign::<$number>::gathered::<F>(F::gather(&each)));
                })*
            };
        }
        to!(f64, Dual<f64, 8>, Lanes<4>);
        panic!("parts of other crates run as numbers, as duals of 8, and as 4 lanes")
    }
}

fn of<T: 'static>(part: &dyn Any) -> &T {
    part.downcast_ref().expect("the part's own type")
}

/// Functions of a part for its own numbers.
trait Object<P>: Debug + Send + Sync {
    fn copy(&self) -> Box<dyn Object<P>>;
    fn any(&self) -> &dyn Any;
    fn states(&self) -> Vec<State>;
    fn inputs(&self) -> &'static [Input];
    fn input(&self, input: usize) -> P;
    fn input_mut(&mut self, input: usize) -> &mut P;
    fn paths(&self) -> &[Between];
    fn channels(&self) -> Vec<(&'static str, Kind)>;
    fn rests(&self) -> bool;
    fn begin(&self, given: &Given<P>, y: OwnMut<P>, net: &Net<P>, common: &Common<P>);
    fn n_obstacles(&self) -> usize;
    fn obstacles(&self, y: Own<P>, net: &Net<P>, out: &mut [P]);
    fn n_events(&self) -> usize;
    fn event(&self, event: usize, y: Own<P>, net: &Net<P>) -> P;
    fn event_tolerance(&self, event: usize) -> f64;
    fn mode_mut(&mut self, event: usize) -> &mut P;
    fn switch(
        &mut self,
        at: (usize, usize),
        y: OwnMut<P>,
        net: &Net<P>,
        common: &Common<P>,
        accounts: &mut [P],
    ) where
        P: Lane;
    fn find_mode(&mut self, event: usize, y: OwnMut<P>, net: &Net<P>)
    where
        P: Lane;
    fn settle(&self, event: usize, y: OwnMut<P>)
    where
        P: Lane;
}

impl<P: Real, T: Part<P> + Clone + Debug + Send + Sync + 'static> Object<P> for T {
    fn copy(&self) -> Box<dyn Object<P>> {
        Box::new(self.clone())
    }
    fn any(&self) -> &dyn Any {
        self
    }
    fn states(&self) -> Vec<State> {
        Part::states(self)
    }
    fn inputs(&self) -> &'static [Input] {
        Part::inputs(self)
    }
    fn input(&self, input: usize) -> P {
        Part::input(self, input)
    }
    fn input_mut(&mut self, input: usize) -> &mut P {
        Part::input_mut(self, input)
    }
    fn paths(&self) -> &[Between] {
        Part::paths(self)
    }
    fn channels(&self) -> Vec<(&'static str, Kind)> {
        Part::channels(self)
    }
    fn rests(&self) -> bool {
        Part::rests(self)
    }
    fn begin(&self, given: &Given<P>, y: OwnMut<P>, net: &Net<P>, common: &Common<P>) {
        Part::begin(self, given, y, net, common);
    }
    fn n_obstacles(&self) -> usize {
        Part::n_obstacles(self)
    }
    fn obstacles(&self, y: Own<P>, net: &Net<P>, out: &mut [P]) {
        Part::obstacles(self, y, net, out);
    }
    fn n_events(&self) -> usize {
        Part::n_events(self)
    }
    fn event(&self, event: usize, y: Own<P>, net: &Net<P>) -> P {
        Part::event(self, event, y, net)
    }
    fn event_tolerance(&self, event: usize) -> f64 {
        Part::event_tolerance(self, event)
    }
    fn mode_mut(&mut self, event: usize) -> &mut P {
        Part::mode_mut(self, event)
    }
    fn switch(
        &mut self,
        (event, lane): (usize, usize),
        y: OwnMut<P>,
        net: &Net<P>,
        common: &Common<P>,
        accounts: &mut [P],
    ) where
        P: Lane,
    {
        Part::switch(self, event, lane, y, net, common, accounts);
    }
    fn find_mode(&mut self, event: usize, y: OwnMut<P>, net: &Net<P>)
    where
        P: Lane,
    {
        Part::find_mode(self, event, y, net);
    }
    fn settle(&self, event: usize, y: OwnMut<P>)
    where
        P: Lane,
    {
        Part::settle(self, event, y);
    }
}

/// Functions of a part for one scalar type.
trait Run<P, S: Real>: Send + Sync {
    fn place(&self, part: &dyn Any, y: Own<S>, net: &mut Net<S>, common: &Common<P>);
    fn shape(&self, part: &dyn Any, net: &mut Net<S>);
    fn potential(&self, part: &dyn Any, y: Own<S>, net: &mut Net<S>, common: &Common<P>);
    fn flow(&self, part: &dyn Any, path: usize, net: &Net<S>) -> (S, S::Mask);
    fn force(&self, part: &dyn Any, net: &Net<S>) -> S;
    fn exchange(&self, part: &dyn Any, net: &mut Net<S>, common: &Common<P>);
    fn rate(&self, part: &dyn Any, y: Own<S>, dy: OwnMut<S>, net: &mut Net<S>, common: &Common<P>);
    fn stored(&self, part: &dyn Any, y: Own<S>, net: &Net<S>, common: &Common<P>) -> [S; 3];
    fn stores(&self, part: &dyn Any, y: Own<S>, net: &Net<S>, common: &Common<P>) -> Vec<S>;
    fn account(&self, part: &dyn Any, y: [Own<S>; 2], net: &Net<S>, common: &Common<P>, out: &mut [S]);
    fn standing(&self, part: &dyn Any, net: &Net<S>, common: &Common<P>, out: &mut [S]);
}

impl<P: Real, S: Over<P>, T: Part<P> + 'static> Run<P, S> for OfType<T> {
    fn place(&self, part: &dyn Any, y: Own<S>, net: &mut Net<S>, common: &Common<P>) {
        of::<T>(part).place(y, net, common);
    }
    fn shape(&self, part: &dyn Any, net: &mut Net<S>) {
        of::<T>(part).shape(net);
    }
    fn potential(&self, part: &dyn Any, y: Own<S>, net: &mut Net<S>, common: &Common<P>) {
        of::<T>(part).potential(y, net, common);
    }
    fn flow(&self, part: &dyn Any, path: usize, net: &Net<S>) -> (S, S::Mask) {
        of::<T>(part).flow(path, net)
    }
    fn force(&self, part: &dyn Any, net: &Net<S>) -> S {
        of::<T>(part).force(net)
    }
    fn exchange(&self, part: &dyn Any, net: &mut Net<S>, common: &Common<P>) {
        of::<T>(part).exchange(net, common);
    }
    fn rate(&self, part: &dyn Any, y: Own<S>, dy: OwnMut<S>, net: &mut Net<S>, common: &Common<P>) {
        of::<T>(part).rate(y, dy, net, common);
    }
    fn stored(&self, part: &dyn Any, y: Own<S>, net: &Net<S>, common: &Common<P>) -> [S; 3] {
        of::<T>(part).stored(y, net, common)
    }
    fn stores(&self, part: &dyn Any, y: Own<S>, net: &Net<S>, common: &Common<P>) -> Vec<S> {
        of::<T>(part).stores(y, net, common)
    }
    fn account(&self, part: &dyn Any, [y, dy]: [Own<S>; 2], net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        of::<T>(part).account(y, dy, net, common, out);
    }
    fn standing(&self, part: &dyn Any, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        of::<T>(part).standing(net, common, out);
    }
}

/// Forwards a function over a scalar type to the part.
macro_rules! over {
    ($self:ident, $S:ident, $function:ident($($argument:expr),*)) => {{
        let (run, part) = $self.over::<$S>();
        run.$function(part $(, $argument)*)
    }};
}

impl<P: Real> Part<P> for Foreign<P> {
    fn states(&self) -> Vec<State> {
        self.part.states()
    }
    fn inputs(&self) -> &'static [Input] {
        self.part.inputs()
    }
    fn input(&self, input: usize) -> P {
        self.part.input(input)
    }
    fn input_mut(&mut self, input: usize) -> &mut P {
        self.part.input_mut(input)
    }
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, common: &Common<P>) {
        over!(self, S, place(y, net, common));
    }
    fn shape<S: Over<P>>(&self, net: &mut Net<S>) {
        over!(self, S, shape(net));
    }
    fn potential<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, common: &Common<P>) {
        over!(self, S, potential(y, net, common));
    }
    fn paths(&self) -> &[Between] {
        self.part.paths()
    }
    fn flow<S: Over<P>>(&self, path: usize, net: &Net<S>) -> (S, S::Mask) {
        over!(self, S, flow(path, net))
    }
    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        over!(self, S, force(net))
    }
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, common: &Common<P>) {
        over!(self, S, exchange(net, common));
    }
    fn rate<S: Over<P>>(&self, y: Own<S>, dy: OwnMut<S>, net: &mut Net<S>, common: &Common<P>) {
        over!(self, S, rate(y, dy, net, common));
    }
    fn stored<S: Over<P>>(&self, y: Own<S>, net: &Net<S>, common: &Common<P>) -> [S; 3] {
        over!(self, S, stored(y, net, common))
    }
    fn stores<S: Over<P>>(&self, y: Own<S>, net: &Net<S>, common: &Common<P>) -> Vec<S> {
        over!(self, S, stores(y, net, common))
    }
    fn channels(&self) -> Vec<(&'static str, Kind)> {
        self.part.channels()
    }
    fn rests(&self) -> bool {
        self.part.rests()
    }
    fn account<S: Over<P>>(&self, y: Own<S>, dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        over!(self, S, account([y, dy], net, common, out));
    }
    fn standing<S: Over<P>>(&self, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        over!(self, S, standing(net, common, out));
    }
    fn begin(&self, given: &Given<P>, y: OwnMut<P>, net: &Net<P>, common: &Common<P>) {
        self.part.begin(given, y, net, common);
    }
    fn n_obstacles(&self) -> usize {
        self.part.n_obstacles()
    }
    fn obstacles(&self, y: Own<P>, net: &Net<P>, out: &mut [P]) {
        self.part.obstacles(y, net, out);
    }
    fn n_events(&self) -> usize {
        self.part.n_events()
    }
    fn event(&self, event: usize, y: Own<P>, net: &Net<P>) -> P {
        self.part.event(event, y, net)
    }
    fn event_tolerance(&self, event: usize) -> f64 {
        self.part.event_tolerance(event)
    }
    fn mode_mut(&mut self, event: usize) -> &mut P {
        self.part.mode_mut(event)
    }
    fn switch(
        &mut self,
        event: usize,
        lane: usize,
        y: OwnMut<P>,
        net: &Net<P>,
        common: &Common<P>,
        accounts: &mut [P],
    ) where
        P: Lane,
    {
        self.part.switch((event, lane), y, net, common, accounts);
    }
    fn find_mode(&mut self, event: usize, y: OwnMut<P>, net: &Net<P>)
    where
        P: Lane,
    {
        self.part.find_mode(event, y, net);
    }
    fn settle(&self, event: usize, y: OwnMut<P>)
    where
        P: Lane,
    {
        self.part.settle(event, y);
    }
}

/// Declares a part of another crate. It has numbers with one value in each lane, laws that implement `gather`, and
/// fields that are the same in all lanes.
#[macro_export]
macro_rules! own_part {
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

        impl<P> $crate::own::Member for $name<P> {
            type Family = $name<f64>;
        }

        impl $crate::own::Family for $name<f64> {
            type Of<R: $crate::math::Lane> = $name<R>;

            fn gather<R: $crate::math::Lane>(each: &[&$name<f64>]) -> $name<R> {
                $name {
                    $($number: R::of_each(each, |own| own.$number),)*
                    $($law: $law_type::gather(&$crate::math::field(each, |part| &part.$law)),)*
                    $($same: each[0].$same.clone(),)*
                }
            }
        }
    };
}
