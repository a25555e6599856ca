//! Components of other crates, in addition to those of this crate.

use super::{Brings, Build, Component, Instance, KINDS, Kind, Terminals};
use crate::run::Error;
use math::{Deps, Dual, Lane, Over};
use std::any::{Any, TypeId};
use std::marker::PhantomData;
use std::sync::{PoisonError, RwLock};

static OTHERS: RwLock<Vec<&'static dyn Registered>> = RwLock::new(Vec::new());

/// Adds a kind of component that circuits may use, in this process. Adding the same kind again changes nothing.
///
/// # Errors
///
/// Another component of this kind exists.
pub fn register<C: Component>() -> Result<(), Error> {
    let own: &'static dyn Registered = const { &OfType::<C>(PhantomData) };
    let mut others = OTHERS.write().unwrap_or_else(PoisonError::into_inner);
    if others.iter().any(|other| other.of() == own.of()) {
        return Ok(());
    }
    let key = own.kind().key;
    let taken = KINDS.iter().copied().chain(others.iter().map(|other| other.kind()));
    if key.is_empty() || taken.into_iter().any(|other| other.key == key) {
        let what = if key.is_empty() { "has no key" } else { "exists already" };
        return Err(Error::Specification(format!("component \"{key}\" {what}: give it another key")));
    }
    others.push(own);
    Ok(())
}

/// Every kind of component: those of this crate, then those that were added.
pub fn kinds() -> Vec<&'static Kind> {
    let others = OTHERS.read().unwrap_or_else(PoisonError::into_inner);
    KINDS.iter().copied().chain(others.iter().map(|other| other.kind())).collect()
}

/// Returns the kind at an index of [`kinds`].
pub(super) fn kind(place: usize) -> &'static Kind {
    KINDS.get(place).copied().unwrap_or_else(|| at(place).kind())
}

/// Returns the component of another crate at an index of [`kinds`].
pub(super) fn at(place: usize) -> &'static dyn Registered {
    OTHERS.read().unwrap_or_else(PoisonError::into_inner)[place - KINDS.len()]
}

/// A component of another crate as an object, for the scalar types of circuits.
pub(super) trait Registered: Send + Sync {
    fn of(&self) -> TypeId;
    fn kind(&self) -> &'static Kind;
    fn check(&self, own: &Instance<f64>) -> Result<(), Error>;
    /// Returns the contribution of a component to a joint, as numbers of the type of `own`.
    fn bring(&self, own: &dyn Any, port: usize, ambient_temperature: &dyn Any) -> Box<dyn Any>;
    /// Returns the contribution of a component to a series of components, as numbers of the type of `own`.
    fn series(&self, own: &dyn Any) -> Box<dyn Any>;
    fn compose(&self, own: &dyn Any, at: &Terminals, build: &mut dyn Any);
}

impl dyn Registered {
    pub fn bring_as<P: Lane>(&self, own: &Instance<P>, port: usize, ambient_temperature: P) -> Brings<P> {
        *self.bring(own, port, &ambient_temperature).downcast().expect("the same numbers")
    }

    pub fn series_as<P: Lane>(&self, own: &Instance<P>) -> Option<[P; 2]> {
        *self.series(own).downcast().expect("the same numbers")
    }
}

struct OfType<C>(PhantomData<fn() -> C>);

fn bring_of<C: Component, P: Lane>(own: &dyn Any, port: usize, ambient: &dyn Any) -> Option<Box<dyn Any>> {
    Some(Box::new(C::bring(own.downcast_ref::<Instance<P>>()?, port, *ambient.downcast_ref::<P>()?)))
}

fn series_of<C: Component, P: Lane>(own: &dyn Any) -> Option<Box<dyn Any>> {
    Some(Box::new(C::series(own.downcast_ref::<Instance<P>>()?)))
}

fn compose_of<C: Component, P: Lane>(own: &dyn Any, at: &Terminals, build: &mut dyn Any) -> Option<()>
where
    Deps: Over<P>,
{
    C::compose(own.downcast_ref::<Instance<P>>()?, at, build.downcast_mut::<Build<P>>()?);
    Some(())
}

/// Numbers with derivatives for several shots.
type Sensitive = Dual<f64, { crate::assembly::DIRECTIONS }>;

impl<C: Component> Registered for OfType<C> {
    fn of(&self) -> TypeId {
        TypeId::of::<C>()
    }

    fn kind(&self) -> &'static Kind {
        const { &C::KIND }
    }

    fn check(&self, own: &Instance<f64>) -> Result<(), Error> {
        C::check(own)
    }

    fn bring(&self, own: &dyn Any, port: usize, ambient: &dyn Any) -> Box<dyn Any> {
        let plain = bring_of::<C, f64>(own, port, ambient);
        plain.or_else(|| bring_of::<C, Sensitive>(own, port, ambient)).expect("numbers of a circuit")
    }

    fn series(&self, own: &dyn Any) -> Box<dyn Any> {
        series_of::<C, f64>(own).or_else(|| series_of::<C, Sensitive>(own)).expect("numbers of a circuit")
    }

    fn compose(&self, own: &dyn Any, at: &Terminals, build: &mut dyn Any) {
        let plain = compose_of::<C, f64>(own, at, build);
        plain.or_else(|| compose_of::<C, Sensitive>(own, at, build)).expect("numbers of a circuit");
    }
}
