//! Components of other crates, in addition to those of this crate.

use super::build::{Build, Component};
use super::instance::{Brings, Instance, Terminals};
use super::kind::Kind;
use crate::ground::{Error, Sensitive};
use math::{Deps, Lane, Over};
use std::any::{Any, TypeId};
use std::marker::PhantomData;
use std::sync::{PoisonError, RwLock};

static OTHERS: RwLock<Vec<&'static dyn Registered>> = RwLock::new(Vec::new());

/// Adds a kind to those of other crates, unless `is_taken` says that its key exists.
pub(super) fn add<C: Component>(is_taken: impl Fn(&str) -> bool) -> Result<(), Error> {
    let own: &'static dyn Registered = const { &OfType::<C>(PhantomData) };
    let mut others = OTHERS.write().unwrap_or_else(PoisonError::into_inner);
    if others.iter().any(|other| other.of() == own.of()) {
        return Ok(());
    }
    let key = own.kind().key;
    if key.is_empty() || is_taken(key) || others.iter().any(|other| other.kind().key == key) {
        let what = if key.is_empty() { "has no key" } else { "exists already" };
        return Err(Error::Specification(format!("component \"{key}\" {what}: give it another key")));
    }
    others.push(own);
    Ok(())
}

/// The kinds of other crates.
pub(super) fn others() -> Vec<&'static Kind> {
    let others = OTHERS.read().unwrap_or_else(PoisonError::into_inner);
    others.iter().map(|other| other.kind()).collect()
}

/// Returns the component of another crate at an index of [`others`].
pub(super) fn at(place: usize) -> &'static dyn Registered {
    OTHERS.read().unwrap_or_else(PoisonError::into_inner)[place]
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
