//! `pneudrive.h`: twelve functions for C programs.
#![allow(unsafe_code, clippy::missing_safety_doc)]

use crate::abi::{ANY, fill, free, given, put, text, with};
use crate::instance::{FmiStatus, FmuInstance, Listener, Logger, c_text};
use crate::processor;
use crate::refusal::refuse;
use std::ffi::{CStr, CString, c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

type Drive = *mut FmuInstance;

/// Defines operations on a drive. They return 0 for success, otherwise 1 with a message.
macro_rules! operations {
    ($($name:ident($own:ident $(, $argument:ident: $kind:ty)*) => $work:expr;)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $name(drive: Drive $(, $argument: $kind)*) -> c_int {
                // SAFETY: the header states the rules for pointers.
                let status = unsafe { with(drive, "", ANY, |$own| $work) };
                c_int::from(status != FmiStatus::Ok)
            }
        )*
    };
}

operations! {
    pneudrive_command(own, command: f64) => own.kept.model.set(own.kept.model.named("command")?, command);
    pneudrive_force(own, force_n: f64) => own.kept.model.set(own.kept.model.named("force")?, force_n);
    pneudrive_set(own, name: *const c_char, value: f64) =>
        own.kept.model.set(own.kept.model.named(text(name).unwrap_or_default())?, value);
    pneudrive_step(own, by_s: f64) => {
        own.kept.model.begin()?;
        own.kept.model.step(own.kept.model.time(), by_s)
    };
    pneudrive_read(own, name: *const c_char, value: *mut f64) => {
        put(value, own.kept.model.get(own.kept.model.named(text(name).unwrap_or_default())?)?);
        Ok(())
    };
    pneudrive_saved_size(own, size: *mut usize) => {
        put(size, FmuInstance::bytes(&own.kept)?.len());
        Ok(())
    };
    pneudrive_save(own, bytes: *mut u8, size: usize) => fill("bytes", bytes, size, &FmuInstance::bytes(&own.kept)?);
    pneudrive_restore(own, bytes: *const u8, size: usize) => {
        own.kept = own.kept(given(bytes, size)?)?;
        Ok(())
    };
}

/// Copies a text as far as there is room, with its final zero.
unsafe fn write_text(text: &CStr, target: *mut c_char, size: usize) {
    let bytes = text.to_bytes();
    let n = bytes.len().min(size.saturating_sub(1));
    if !target.is_null() && size > 0 {
        // SAFETY: the header requires room for `size` characters.
        unsafe {
            ptr::copy_nonoverlapping(bytes.as_ptr(), target.cast(), n);
            target.add(n).write(0);
        }
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn pneudrive_create(json: *const c_char, message: *mut c_char, size: usize) -> Drive {
    // SAFETY: the header states the rules for pointers.
    unsafe {
        if processor::lacking().is_some() {
            write_text(processor::MESSAGE, message, size);
            return ptr::null_mut();
        }
        let made = catch_unwind(AssertUnwindSafe(|| {
            let listener =
                Listener { logger: Logger::None, environment: ptr::null_mut(), name: CString::default() };
            let Some(json) = text(json) else { return refuse("the description is not a text in UTF-8") };
            let mut drive = FmuInstance::new(json, None, false, listener)?;
            drive.kept.model.n_states()?; // it can begin
            Ok(drive)
        }));
        let why = match made {
            Ok(Ok(drive)) => return Box::into_raw(Box::new(drive)),
            Ok(Err(refusal)) => refusal.message,
            Err(_) => "internal error".into(),
        };
        write_text(&c_text(&why), message, size);
        ptr::null_mut()
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn pneudrive_free(drive: Drive) {
    // SAFETY: the header states the rules for pointers.
    unsafe { free(drive) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn pneudrive_message(drive: Drive) -> *const c_char {
    // SAFETY: the header states the rules for pointers.
    unsafe { drive.as_ref() }.map_or(c"there is no drive".as_ptr(), |own| own.message.as_ptr())
}

#[unsafe(no_mangle)]
pub extern "C" fn pneudrive_version() -> *const c_char {
    const { concat!(env!("CARGO_PKG_VERSION"), "\0") }.as_ptr().cast()
}
