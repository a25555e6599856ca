//! How the core is linked where that is by LLD: functions of one name beside each other. The same function for other
//! numbers is packed into a fortieth less of a wheel there; it runs as it does anywhere.

fn main() {
    println!("cargo::rerun-if-changed=by_name.ld");
    if std::env::var("TARGET").is_ok_and(|target| target == "x86_64-unknown-linux-gnu") {
        let folder = std::env::var("CARGO_MANIFEST_DIR").expect("cargo says it");
        println!("cargo::rustc-cdylib-link-arg=-T{folder}/by_name.ld");
        // Cargo itself strips nothing that a package with settings of its own is linked into.
        println!("cargo::rustc-cdylib-link-arg=-Wl,--strip-all");
    }
}
