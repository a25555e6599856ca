//! FMI 3.0: co-simulation and model exchange. Functions have the names of the standard.
#![allow(unsafe_code, non_snake_case, clippy::missing_safety_doc)]

use crate::abi::{ANY, fill, free, free_state, given, instantiate, keep, put, revive, room, state, with};
use crate::fmi2::{EXCHANGE, common, functions, no};
use crate::instance::{ALIVE, FmiStatus, FmuInstance, KeptState, Logger, Phase, RUNNING};
use crate::model::{StateQuantity, check_length};
use crate::refusal::refuse;
use std::ffi::{c_char, c_int, c_void};
use std::ptr;

type Component = *mut FmuInstance;
type References = *const u32;
type Log = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateModelExchange(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    _logging: bool,
    environment: *mut c_void,
    log: Option<Log>,
) -> Component {
    // SAFETY: the standard requires valid pointers of the tool.
    unsafe { instantiate(name, token, resources, true, log.map_or(Logger::None, Logger::Three), environment) }
}

#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments)]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    _logging: bool,
    _event_mode: bool,
    _early_return: bool,
    _intermediate: References,
    _n_intermediate: usize,
    environment: *mut c_void,
    log: Option<Log>,
    _update: *const c_void,
) -> Component {
    // SAFETY: the standard requires valid pointers of the tool.
    unsafe {
        instantiate(name, token, resources, false, log.map_or(Logger::None, Logger::Three), environment)
    }
}

#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments)]
pub unsafe extern "C" fn fmi3InstantiateScheduledExecution(
    name: *const c_char,
    _token: *const c_char,
    _resources: *const c_char,
    _visible: bool,
    _logging: bool,
    environment: *mut c_void,
    log: Option<Log>,
    _clock_update: *const c_void,
    _lock: *const c_void,
    _unlock: *const c_void,
) -> Component {
    let message = c"scheduled execution is not possible: use co-simulation or model exchange";
    // SAFETY: the standard requires valid pointers of the tool.
    unsafe { log.map_or(Logger::None, Logger::Three).send(environment, name, FmiStatus::Error, message) }
    ptr::null_mut()
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeInstance(instance: Component) {
    // SAFETY: guaranteed by the standard.
    unsafe { free(instance) }
}

common! {
    bool: fmi3SetDebugLogging fmi3CompletedIntegratorStep
    fmi3ExitInitializationMode fmi3Terminate fmi3Reset fmi3GetFMUState fmi3SetFMUState fmi3FreeFMUState
    fmi3SerializedFMUStateSize fmi3SerializeFMUState fmi3DeserializeFMUState fmi3EnterEventMode
    fmi3EnterContinuousTimeMode fmi3SetTime fmi3SetContinuousStates fmi3GetContinuousStates
    fmi3GetContinuousStateDerivatives fmi3GetNominalsOfContinuousStates fmi3GetEventIndicators
}

functions! {
    fmi3EnterInitializationMode(instance, has_tolerance: bool, tolerance: f64, start: f64, has_stop: bool, stop: f64)
        in &[Phase::Instantiated] => {
            instance.kept.model.set_up(start, has_stop.then_some(stop), has_tolerance.then_some(tolerance))?;
            instance.pass_to(Phase::Initialisation)
        };

    fmi3GetFloat64(instance, references: References, n: usize, values: *mut f64, n_values: usize) in ANY => {
        check_length("values", n_values, n)?;
        instance.get(given(references, n)?, room(values, n)?)
    };
    fmi3SetFloat64(instance, references: References, n: usize, values: *const f64, n_values: usize) in ALIVE => {
        check_length("values", n_values, n)?;
        instance.set(given(references, n)?, given(values, n)?)
    };

    fmi3GetDirectionalDerivative(
        instance, unknowns: References, n_unknowns: usize, knowns: References, n_knowns: usize,
        seed: *const f64, n_seed: usize, sensitivity: *mut f64, n_sensitivity: usize
    ) in DIFFERENTIABLE => {
        let (unknowns, knowns) = (given(unknowns, n_unknowns)?, given(knowns, n_knowns)?);
        let found = instance.kept.model.directional(unknowns, knowns, given(seed, n_seed)?, false)?;
        fill("unknowns", sensitivity, n_sensitivity, &found)
    };
    fmi3GetAdjointDerivative(
        instance, unknowns: References, n_unknowns: usize, knowns: References, n_knowns: usize,
        seed: *const f64, n_seed: usize, sensitivity: *mut f64, n_sensitivity: usize
    ) in DIFFERENTIABLE => {
        let (unknowns, knowns) = (given(unknowns, n_unknowns)?, given(knowns, n_knowns)?);
        let found = instance.kept.model.directional(unknowns, knowns, given(seed, n_seed)?, true)?;
        fill("knowns", sensitivity, n_sensitivity, &found)
    };

    fmi3EvaluateDiscreteStates(_instance) in &[Phase::Initialisation, Phase::Event] => Ok(());
    fmi3UpdateDiscreteStates(
        instance, needed: *mut bool, terminate: *mut bool, nominals: *mut bool, values: *mut bool,
        has_next: *mut bool, next: *mut f64
    ) in &[Phase::Event] => {
        let update = instance.kept.model.update()?;
        [needed, terminate, nominals].into_iter().for_each(|flag| put(flag, false));
        put(values, update.states_changed);
        put(has_next, update.next.is_some());
        put(next, update.next.unwrap_or(0.0));
        Ok(())
    };
    fmi3GetNumberOfEventIndicators(instance, n: *mut usize) in ANY => {
        put(n, instance.kept.model.events()?.len());
        Ok(())
    };
    fmi3GetNumberOfContinuousStates(instance, n: *mut usize) in ANY => {
        put(n, instance.kept.model.n_states()?);
        Ok(())
    };

    fmi3EnterStepMode(_instance) in &[Phase::Event] => refuse("a step of co-simulation needs no event mode");
    fmi3GetOutputDerivatives(_instance, _references: References, n: usize, _orders: *const i32, _values: *mut f64, _n_values: usize)
        in ANY => check_length("derivatives of outputs", n, 0);
    fmi3DoStep(
        instance, from: f64, by: f64, _no_set: bool, event: *mut bool, terminate: *mut bool, early: *mut bool,
        last: *mut f64
    ) in &[Phase::Step] => {
        [event, terminate, early].into_iter().for_each(|flag| put(flag, false));
        let done = instance.kept.model.step(from, by);
        put(last, instance.kept.model.time());
        done
    };

    fmi3GetNumberOfVariableDependencies(_instance, _reference: u32, _n: *mut usize) in ANY =>
        refuse("dependencies are those of modelDescription.xml");
    fmi3GetVariableDependencies(
        _instance, _dependent: u32, _elements: *mut usize, _independents: *mut u32, _of: *mut usize,
        _kinds: *mut c_int, _n: usize
    ) in ANY => refuse("dependencies are those of modelDescription.xml");
    fmi3EnterConfigurationMode(_instance) in ANY => refuse("there are no structural parameters");
    fmi3ExitConfigurationMode(_instance) in ANY => refuse("there are no structural parameters");
    fmi3GetClock(_instance, _references: References, n: usize, _values: *mut bool) in ANY => no("Clock", n);
    fmi3SetClock(_instance, _references: References, n: usize, _values: *const bool) in ANY => no("Clock", n);
    fmi3GetBinary(_instance, _references: References, n: usize, _sizes: *mut usize, _values: *mut *const u8, _n_values: usize)
        in ANY => no("Binary", n);
    fmi3SetBinary(_instance, _references: References, n: usize, _sizes: *const usize, _values: *const *const u8, _n_values: usize)
        in ANY => no("Binary", n);
    fmi3GetIntervalDecimal(_instance, _references: References, n: usize, _intervals: *mut f64, _qualifiers: *mut c_int)
        in ANY => no("Clock", n);
    fmi3GetIntervalFraction(_instance, _references: References, n: usize, _counters: *mut u64, _resolutions: *mut u64, _qualifiers: *mut c_int)
        in ANY => no("Clock", n);
    fmi3GetShiftDecimal(_instance, _references: References, n: usize, _shifts: *mut f64) in ANY => no("Clock", n);
    fmi3GetShiftFraction(_instance, _references: References, n: usize, _counters: *mut u64, _resolutions: *mut u64)
        in ANY => no("Clock", n);
    fmi3SetIntervalDecimal(_instance, _references: References, n: usize, _intervals: *const f64) in ANY => no("Clock", n);
    fmi3SetIntervalFraction(_instance, _references: References, n: usize, _counters: *const u64, _resolutions: *const u64)
        in ANY => no("Clock", n);
    fmi3SetShiftDecimal(_instance, _references: References, n: usize, _shifts: *const f64) in ANY => no("Clock", n);
    fmi3SetShiftFraction(_instance, _references: References, n: usize, _counters: *const u64, _resolutions: *const u64)
        in ANY => no("Clock", n);
    fmi3ActivateModelPartition(_instance, _clock: u32, _t: f64) in ANY => refuse("there are no model partitions");
}

/// Functions for variables of other types, which the model does not have.
macro_rules! absent {
    ($($get:ident $set:ident $kind:ident: $value:ty;)*) => {
        functions! {
            $(
                $get(_instance, _references: References, n: usize, _values: *mut $value, _n_values: usize)
                    in ANY => no(stringify!($kind), n);
                $set(_instance, _references: References, n: usize, _values: *const $value, _n_values: usize)
                    in ANY => no(stringify!($kind), n);
            )*
        }
    };
}

absent! {
    fmi3GetFloat32 fmi3SetFloat32 Float32: f32;
    fmi3GetInt8 fmi3SetInt8 Int8: i8;
    fmi3GetUInt8 fmi3SetUInt8 UInt8: u8;
    fmi3GetInt16 fmi3SetInt16 Int16: i16;
    fmi3GetUInt16 fmi3SetUInt16 UInt16: u16;
    fmi3GetInt32 fmi3SetInt32 Int32: i32;
    fmi3GetUInt32 fmi3SetUInt32 UInt32: u32;
    fmi3GetInt64 fmi3SetInt64 Int64: i64;
    fmi3GetUInt64 fmi3SetUInt64 UInt64: u64;
    fmi3GetBoolean fmi3SetBoolean Boolean: bool;
    fmi3GetString fmi3SetString String: *const c_char;
}

/// Phases in which derivatives exist.
const DIFFERENTIABLE: &[Phase] = &[Phase::Initialisation, Phase::Event, Phase::Continuous, Phase::Step];
