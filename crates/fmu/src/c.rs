//! `pneudrive.h`: twelve functions for C programs.
#![allow(unsafe_code, clippy::missing_safety_doc)]

use crate::abi::{ANY, fill, free, given, is_able, put, text, with};
use crate::instance::{Instance, Listener, Logger, Status, c_text};
use crate::refusal::{Refusal, refuse};
use std::ffi::{CString, c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

type Drive = *mut Instance;

/// 0 for success, otherwise 1 with a message.
fn flag(status: Status) -> c_int {
    c_int::from(status != Status::Ok)
}

/// Runs an operation on a drive.
unsafe fn act(drive: Drive, work: impl FnOnce(&mut Instance) -> Result<(), Refusal>) -> c_int {
    // SAFETY: the header states the rules for pointers.
    flag(unsafe { with(drive, "", ANY, work) })
}

/// Copies a text as far as there is room, with its final zero.
unsafe fn write_text(text: &CString, target: *mut c_char, size: usize) {
    let bytes = text.as_bytes();
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
        if !is_able(|why| write_text(&std::ffi::CStr::from_ptr(why).to_owned(), message, size)) {
            return ptr::null_mut();
        }
        let made = catch_unwind(AssertUnwindSafe(|| {
            let listener =
                Listener { logger: Logger::None, environment: ptr::null_mut(), name: CString::default() };
            let Some(json) = text(json) else { return refuse("the description is not a text in UTF-8") };
            let mut drive = Instance::new(json, None, false, listener)?;
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
pub unsafe extern "C" fn pneudrive_command(drive: Drive, command: f64) -> c_int {
    // SAFETY: the header states the rules for pointers.
    unsafe { act(drive, |own| own.kept.model.set(own.kept.model.named("command")?, command)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn pneudrive_force(drive: Drive, force_n: f64) -> c_int {
    // SAFETY: the header states the rules for pointers.
    unsafe { act(drive, |own| own.kept.model.set(own.kept.model.named("force")?, force_n)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn pneudrive_set(drive: Drive, name: *const c_char, value: f64) -> c_int {
    // SAFETY: the header states the rules for pointers.
    unsafe {
        act(drive, |own| own.kept.model.set(own.kept.model.named(text(name).unwrap_or_default())?, value))
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn pneudrive_step(drive: Drive, by_s: f64) -> c_int {
    // SAFETY: the header states the rules for pointers.
    unsafe {
        act(drive, |own| {
            own.kept.model.begin()?;
            own.kept.model.step(own.kept.model.time(), by_s)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn pneudrive_read(drive: Drive, name: *const c_char, value: *mut f64) -> c_int {
    // SAFETY: the header states the rules for pointers.
    unsafe {
        act(drive, |own| {
            let read = own.kept.model.get(own.kept.model.named(text(name).unwrap_or_default())?)?;
            put(value, read);
            Ok(())
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn pneudrive_saved_size(drive: Drive, size: *mut usize) -> c_int {
    // SAFETY: the header states the rules for pointers.
    unsafe {
        act(drive, |own| {
            put(size, Instance::bytes(&own.kept)?.len());
            Ok(())
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn pneudrive_save(drive: Drive, bytes: *mut u8, size: usize) -> c_int {
    // SAFETY: the header states the rules for pointers.
    unsafe { act(drive, |own| fill("bytes", bytes, size, &Instance::bytes(&own.kept)?)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn pneudrive_restore(drive: Drive, bytes: *const u8, size: usize) -> c_int {
    // SAFETY: the header states the rules for pointers.
    unsafe {
        act(drive, |own| {
            own.kept = own.kept(given(bytes, size)?)?;
            Ok(())
        })
    }
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
