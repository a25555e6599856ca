//! Checks the pointers of a C caller, and turns them into slices, texts and instances.
#![allow(unsafe_code)]

use crate::instance::{FmiStatus, FmuInstance, KeptState, Listener, Logger, Phase, c_text};
use crate::processor;
use crate::refusal::{CallRefusal, refuse};
use std::ffi::{CStr, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::{ptr, slice};

/// All phases.
pub const ANY: &[Phase] = &[
    Phase::Instantiated,
    Phase::Initialisation,
    Phase::Event,
    Phase::Continuous,
    Phase::Step,
    Phase::Terminated,
];

/// Runs an operation on an instance in one of the allowed phases.
///
/// # Safety
/// `instance` is null, or was made by one of our functions and not freed.
pub unsafe fn with(
    instance: *mut FmuInstance,
    what: &str,
    phases: &[Phase],
    work: impl FnOnce(&mut FmuInstance) -> Result<(), CallRefusal>,
) -> FmiStatus {
    // SAFETY: guaranteed by the caller.
    match unsafe { instance.as_mut() } {
        Some(instance) => instance.call(what, phases, work),
        None => FmiStatus::Error,
    }
}

/// Returns `n` values to read.
///
/// # Safety
/// `values` is null, or points to `n` values that live as long as the slice.
pub unsafe fn given<'a, T>(values: *const T, n: usize) -> Result<&'a [T], CallRefusal> {
    match (n, values.is_null()) {
        (0, _) => Ok(&[]),
        (_, true) => refuse("a null pointer was given for an array"),
        // SAFETY: guaranteed by the caller.
        _ => Ok(unsafe { slice::from_raw_parts(values, n) }),
    }
}

/// Returns room for `n` values.
///
/// # Safety
/// As for [`given`], and the caller has exclusive access.
pub unsafe fn room<'a, T>(values: *mut T, n: usize) -> Result<&'a mut [T], CallRefusal> {
    match (n, values.is_null()) {
        (0, _) => Ok(&mut []),
        (_, true) => refuse("a null pointer was given for an array"),
        // SAFETY: guaranteed by the caller.
        _ => Ok(unsafe { slice::from_raw_parts_mut(values, n) }),
    }
}

/// Writes values into room for `n`.
///
/// # Safety
/// As for [`room`].
pub unsafe fn fill<T: Copy>(what: &str, target: *mut T, n: usize, values: &[T]) -> Result<(), CallRefusal> {
    crate::model::check_length(what, n, values.len())?;
    // SAFETY: guaranteed by the caller.
    unsafe { room(target, n)? }.copy_from_slice(values);
    Ok(())
}

/// Writes one value unless the target is null.
///
/// # Safety
/// `target` is null or has room for the value.
pub unsafe fn put<T>(target: *mut T, value: T) {
    if !target.is_null() {
        // SAFETY: guaranteed by the caller.
        unsafe { target.write(value) }
    }
}

/// Returns a text, or `None` for a null pointer and for invalid UTF-8.
///
/// # Safety
/// `text` is null or ends with a zero.
pub unsafe fn text<'a>(text: *const c_char) -> Option<&'a str> {
    // SAFETY: guaranteed by the caller.
    (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_str().ok())?
}

/// Returns the folder of a resource location: a path, or a `file:` URI.
fn folder(location: &str) -> PathBuf {
    let Some(rest) = location.strip_prefix("file:") else { return PathBuf::from(location) };
    let path = rest.strip_prefix("//").map_or(rest, |rest| rest.find('/').map_or("", |start| &rest[start..]));
    let mut bytes = Vec::with_capacity(path.len());
    let mut left = path.as_bytes();
    while let [first, rest @ ..] = left {
        let code = rest.get(..2).filter(|_| *first == b'%').and_then(|code| std::str::from_utf8(code).ok());
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                left = &rest[2..];
            }
            None => {
                bytes.push(*first);
                left = rest;
            }
        }
    }
    PathBuf::from(String::from_utf8_lossy(&bytes).into_owned())
}

/// Creates an instance, or sends a message and returns null.
///
/// # Safety
/// The texts are null or end with a zero, and `environment` is that of the logger.
pub unsafe fn instantiate(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    outside: bool,
    logger: Logger,
    environment: *mut c_void,
) -> *mut FmuInstance {
    if processor::lacking().is_some() {
        // SAFETY: guaranteed by the caller.
        unsafe { logger.send(environment, name, FmiStatus::Error, processor::MESSAGE) };
        return ptr::null_mut();
    }
    // SAFETY: guaranteed by the caller.
    let [name, token, resources] = [name, token, resources].map(|own| unsafe { text(own) });
    let made = catch_unwind(AssertUnwindSafe(|| {
        let listener = || Listener { logger, environment, name: c_text(name.unwrap_or("pneudrive")) };
        let Some(resources) = resources else {
            return Err((listener(), "the folder of the resources is missing".to_string()));
        };
        let path: &Path = &folder(resources).join("drive.json");
        let made = std::fs::read_to_string(path)
            .or_else(|error| refuse(format!("{} cannot be read: {error}", path.display())))
            .and_then(|text| FmuInstance::new(&text, Some(token.unwrap_or_default()), outside, listener()));
        made.map_err(|refusal| (listener(), refusal.message))
    }));
    match made {
        Ok(Ok(instance)) => Box::into_raw(Box::new(instance)),
        Ok(Err((listener, message))) => {
            listener.tell(FmiStatus::Error, &message);
            ptr::null_mut()
        }
        Err(_) => ptr::null_mut(),
    }
}

/// Frees an instance.
///
/// # Safety
/// As for [`with`]. The instance is not used again.
pub unsafe fn free(instance: *mut FmuInstance) {
    if !instance.is_null() {
        // SAFETY: guaranteed by the caller.
        let instance = unsafe { Box::from_raw(instance) };
        let _ = catch_unwind(AssertUnwindSafe(|| drop(instance)));
    }
}

/// Keeps the state of an instance, in place of an earlier state.
///
/// # Safety
/// `target` is null, or points to null or to one of our states.
pub unsafe fn keep(instance: &FmuInstance, target: *mut *mut KeptState) -> Result<(), CallRefusal> {
    // SAFETY: guaranteed by the caller.
    let Some(place) = (unsafe { target.as_mut() }) else {
        return refuse("a null pointer was given for the state");
    };
    // SAFETY: guaranteed by the caller.
    match unsafe { place.as_mut() } {
        Some(kept) => kept.clone_from(&instance.kept),
        None => *place = Box::into_raw(Box::new(instance.kept.clone())),
    }
    Ok(())
}

/// Returns a kept state.
///
/// # Safety
/// `kept` is null, or one of our states that was not freed.
pub unsafe fn state<'a>(kept: *const KeptState) -> Result<&'a KeptState, CallRefusal> {
    // SAFETY: guaranteed by the caller.
    match unsafe { kept.as_ref() } {
        Some(kept) => Ok(kept),
        None => refuse("a null pointer was given for the state"),
    }
}

/// Frees a kept state and sets the pointer to null.
///
/// # Safety
/// As for [`keep`].
pub unsafe fn free_state(target: *mut *mut KeptState) {
    // SAFETY: guaranteed by the caller.
    if let Some(place) = unsafe { target.as_mut() }
        && !place.is_null()
    {
        // SAFETY: guaranteed by the caller.
        drop(unsafe { Box::from_raw(*place) });
        *place = ptr::null_mut();
    }
}

/// Restores a state from bytes into a pointer.
///
/// # Safety
/// As for [`keep`] and [`given`].
pub unsafe fn revive(
    instance: &FmuInstance,
    bytes: *const u8,
    size: usize,
    target: *mut *mut KeptState,
) -> Result<(), CallRefusal> {
    // SAFETY: guaranteed by the caller.
    let (kept, place) = unsafe { (instance.kept(given(bytes, size)?)?, target.as_mut()) };
    let Some(place) = place else { return refuse("a null pointer was given for the state") };
    *place = Box::into_raw(Box::new(kept));
    Ok(())
}

#[cfg(test)]
#[path = "../tests/unit/abi.rs"]
mod tests;
