//! Private functions of `abi.rs`.

use super::folder;
use std::path::PathBuf;

#[test]
fn resources_are_found_by_path_and_by_uri() {
    let path = PathBuf::from("/tmp/a drive/ü");
    for location in [
        "/tmp/a drive/ü",
        "file:///tmp/a%20drive/%C3%BC",
        "file:/tmp/a drive/%c3%bc",
        "file://localhost/tmp/a%20drive/ü",
    ] {
        assert_eq!(folder(location), path, "{location}");
    }
}
