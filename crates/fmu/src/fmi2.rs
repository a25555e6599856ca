//! FMI 2.0: co-simulation and model exchange. Functions have the names of the standard.
#![allow(unsafe_code, non_snake_case, clippy::missing_safety_doc)]

use crate::abi::{ANY, fill, free, free_state, given, instantiate, keep, put, revive, room, state, with};
use crate::instance::{ALIVE, FmiStatus, FmuInstance, KeptState, Logger, Phase, RUNNING};
use crate::model::{StateQuantity, check_length};
use crate::refusal::refuse;
use std::ffi::{c_char, c_int, c_uint, c_void};
use std::ptr;

type Component = *mut FmuInstance;
type Reference = c_uint;
type Log = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// Callbacks of the tool.
#[repr(C)]
pub struct Callbacks {
    logger: Option<Log>,
    allocate_memory: *const c_void,
    free_memory: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

/// Result of an event.
#[repr(C)]
pub struct EventInfo {
    new_discrete_states_needed: c_int,
    terminate_simulation: c_int,
    nominals_changed: c_int,
    values_changed: c_int,
    next_event_time_defined: c_int,
    next_event_time: f64,
}

/// Defines functions of an instance, with their allowed phases and their bodies.
macro_rules! functions {
    ($($name:ident($instance:ident $(, $argument:ident: $kind:ty)*) in $phases:expr => $work:expr;)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $name(component: Component $(, $argument: $kind)*) -> FmiStatus {
                // SAFETY: the standard requires valid pointers of the tool.
                unsafe { with(component, stringify!($name), $phases, |$instance| $work) }
            }
        )*
    };
}
pub(crate) use functions;

/// Defines the functions that both standards have, under their names.
macro_rules! common {
    ($flag:ident: $debug:ident $completed:ident $exit:ident $terminate:ident $reset:ident $get_state:ident $set_state:ident $free_state:ident $size:ident $serialise:ident $revive:ident $enter_event:ident $enter_continuous:ident $set_time:ident $set_states:ident $states:ident $rates:ident $sizes:ident $indicators:ident) => { functions! {
        $debug(_instance, _on: $flag, _n: usize, _categories: *const *const c_char) in ANY => Ok(());
        $completed(instance, _no_set: $flag, event: *mut $flag, terminate: *mut $flag) in &[Phase::Continuous] => {
            put(event, $flag::from(instance.kept.model.is_due_behind_step()?));
            put(terminate, $flag::from(false));
            Ok(())
        };
        $exit(instance) in &[Phase::Initialisation] => instance.begin();
        $terminate(instance) in RUNNING => instance.pass_to(Phase::Terminated);
        $reset(instance) in ANY => instance.reset();
        $get_state(instance, target: *mut *mut KeptState) in ANY => keep(instance, target);
        $set_state(instance, kept: *mut KeptState) in ANY => instance.restore(state(kept)?);
        $free_state(_instance, target: *mut *mut KeptState) in ANY => {
            free_state(target);
            Ok(())
        };
        $size(_instance, kept: *mut KeptState, size: *mut usize) in ANY => {
            put(size, FmuInstance::bytes(state(kept)?)?.len());
            Ok(())
        };
        $serialise(_instance, kept: *mut KeptState, bytes: *mut u8, size: usize) in ANY =>
            fill("bytes", bytes, size, &FmuInstance::bytes(state(kept)?)?);
        $revive(instance, bytes: *const u8, size: usize, target: *mut *mut KeptState) in ANY =>
            revive(instance, bytes, size, target);
        $enter_event(instance) in &[Phase::Event, Phase::Continuous] => instance.pass_to(Phase::Event);
        $enter_continuous(instance) in &[Phase::Event] => instance.pass_to(Phase::Continuous);
        $set_time(instance, t: f64) in &[Phase::Event, Phase::Continuous] => instance.kept.model.set_time(t);
        $set_states(instance, x: *const f64, n: usize) in &[Phase::Continuous] =>
            instance.kept.model.set_states(given(x, n)?);
        $states(instance, x: *mut f64, n: usize) in EXCHANGE =>
            fill("states", x, n, &instance.kept.model.states(StateQuantity::Values)?);
        $rates(instance, rates: *mut f64, n: usize) in EXCHANGE =>
            fill("states", rates, n, &instance.kept.model.states(StateQuantity::Rates)?);
        $sizes(instance, nominals: *mut f64, n: usize) in EXCHANGE =>
            fill("states", nominals, n, &instance.kept.model.states(StateQuantity::Sizes)?);
        $indicators(instance, indicators: *mut f64, n: usize) in EXCHANGE =>
            fill("event indicators", indicators, n, &instance.kept.model.events()?);
    } };
}
pub(crate) use common;

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    guid: *const c_char,
    resources: *const c_char,
    functions: *const Callbacks,
    _visible: c_int,
    _logging: c_int,
) -> Component {
    // SAFETY: the standard requires valid pointers of the tool.
    unsafe {
        let (log, environment) =
            functions.as_ref().map_or((None, ptr::null_mut()), |own| (own.logger, own.environment));
        instantiate(name, guid, resources, kind == 0, log.map_or(Logger::None, Logger::Two), environment)
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2FreeInstance(component: Component) {
    // SAFETY: guaranteed by the standard.
    unsafe { free(component) }
}

common! {
    c_int: fmi2SetDebugLogging fmi2CompletedIntegratorStep
    fmi2ExitInitializationMode fmi2Terminate fmi2Reset fmi2GetFMUstate fmi2SetFMUstate fmi2FreeFMUstate
    fmi2SerializedFMUstateSize fmi2SerializeFMUstate fmi2DeSerializeFMUstate fmi2EnterEventMode
    fmi2EnterContinuousTimeMode fmi2SetTime fmi2SetContinuousStates fmi2GetContinuousStates
    fmi2GetDerivatives fmi2GetNominalsOfContinuousStates fmi2GetEventIndicators
}

functions! {
    fmi2SetupExperiment(instance, has_tolerance: c_int, tolerance: f64, start: f64, has_stop: c_int, stop: f64)
        in &[Phase::Instantiated] => {
            let [stop, tolerance] =
                [(has_stop, stop), (has_tolerance, tolerance)].map(|(has, value)| (has != 0).then_some(value));
            instance.kept.model.set_up(start, stop, tolerance)
        };
    fmi2EnterInitializationMode(instance) in &[Phase::Instantiated] => instance.pass_to(Phase::Initialisation);

    fmi2GetReal(instance, references: *const Reference, n: usize, values: *mut f64) in ANY =>
        instance.get(given(references, n)?, room(values, n)?);
    fmi2SetReal(instance, references: *const Reference, n: usize, values: *const f64) in ALIVE =>
        instance.set(given(references, n)?, given(values, n)?);
    fmi2GetInteger(_instance, _references: *const Reference, n: usize, _values: *mut c_int) in ANY => no("Integer", n);
    fmi2SetInteger(_instance, _references: *const Reference, n: usize, _values: *const c_int) in ANY => no("Integer", n);
    fmi2GetBoolean(_instance, _references: *const Reference, n: usize, _values: *mut c_int) in ANY => no("Boolean", n);
    fmi2SetBoolean(_instance, _references: *const Reference, n: usize, _values: *const c_int) in ANY => no("Boolean", n);
    fmi2GetString(_instance, _references: *const Reference, n: usize, _values: *mut *const c_char) in ANY => no("String", n);
    fmi2SetString(_instance, _references: *const Reference, n: usize, _values: *const *const c_char) in ANY => no("String", n);

    fmi2GetDirectionalDerivative(
        instance, unknowns: *const Reference, n_unknowns: usize, knowns: *const Reference, n_knowns: usize,
        seed: *const f64, sensitivity: *mut f64
    ) in &[Phase::Initialisation, Phase::Event, Phase::Continuous, Phase::Step] => {
        let (unknowns, knowns) = (given(unknowns, n_unknowns)?, given(knowns, n_knowns)?);
        let found = instance.kept.model.directional(unknowns, knowns, given(seed, n_knowns)?, false)?;
        fill("unknowns", sensitivity, n_unknowns, &found)
    };

    fmi2NewDiscreteStates(instance, info: *mut EventInfo) in &[Phase::Event] => {
        let update = instance.kept.model.update()?;
        put(info, EventInfo {
            new_discrete_states_needed: 0,
            terminate_simulation: 0,
            nominals_changed: 0,
            values_changed: c_int::from(update.states_changed),
            next_event_time_defined: c_int::from(update.next.is_some()),
            next_event_time: update.next.unwrap_or(0.0),
        });
        Ok(())
    };

    fmi2SetRealInputDerivatives(_instance, _references: *const Reference, n: usize, _orders: *const c_int, _values: *const f64)
        in ANY => check_length("derivatives of inputs", n, 0);
    fmi2GetRealOutputDerivatives(_instance, _references: *const Reference, n: usize, _orders: *const c_int, _values: *mut f64)
        in ANY => check_length("derivatives of outputs", n, 0);
    fmi2DoStep(instance, from: f64, by: f64, _no_set: c_int) in &[Phase::Step] => instance.kept.model.step(from, by);
    fmi2CancelStep(_instance) in ANY => refuse("no step is under way: steps end before they return");
    fmi2GetStatus(_instance, _kind: c_int, _value: *mut c_int) in ANY => refuse("no step is under way");
    fmi2GetRealStatus(instance, kind: c_int, value: *mut f64) in ANY => {
        if kind != LAST_SUCCESSFUL_TIME {
            return refuse("this status is not a real number");
        }
        put(value, instance.kept.model.time());
        Ok(())
    };
    fmi2GetIntegerStatus(_instance, _kind: c_int, _value: *mut c_int) in ANY => refuse("there is no such status");
    fmi2GetBooleanStatus(_instance, kind: c_int, value: *mut c_int) in ANY => {
        if kind != TERMINATED {
            return refuse("this status is not a truth value");
        }
        put(value, 0);
        Ok(())
    };
    fmi2GetStringStatus(_instance, _kind: c_int, _value: *mut *const c_char) in ANY => refuse("there is no such status");
}

/// Kinds of status.
const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;

/// Phases in which the tool may ask for states and rates.
pub(crate) const EXCHANGE: &[Phase] =
    &[Phase::Initialisation, Phase::Event, Phase::Continuous, Phase::Terminated];

/// All variables are real numbers.
pub(crate) fn no(kind: &str, n: usize) -> Result<(), crate::refusal::CallRefusal> {
    if n == 0 { Ok(()) } else { refuse(format!("there is no variable of type {kind}")) }
}
