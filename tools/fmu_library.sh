#!/usr/bin/env bash
# On macOS only: the library of FMUs and C programs, built and put into the package, in the place of an older one in one
# move. On Linux the core itself is that library (python/pneudrive/fmu/binary.py).
set -euo pipefail
cd "$(dirname "$0")/.."
[ "$(uname -s)" = Darwin ] || exit 0
cargo rustc --release --locked --quiet -p pneudrive-fmu --lib --crate-type cdylib
target=python/pneudrive/fmu/libpneudrive.dylib
cp "${CARGO_TARGET_DIR:-target}/release/libpneudrive.dylib" "$target.new"
mv "$target.new" "$target"
