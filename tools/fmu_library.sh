#!/usr/bin/env bash
# Copy the library of FMUs and C programs into the package, in one move. The build of the core has made it, because
# crates/python depends on crates/fmu.
set -euo pipefail
cd "$(dirname "$0")/.."
case "$(uname -s)" in
    Darwin) name=libpneudrive.dylib ;;
    Linux) name=libpneudrive.so ;;
    *) name=pneudrive.dll ;;
esac
target=python/pneudrive/fmu/libpneudrive.${name##*.}
cp "${CARGO_TARGET_DIR:-target}/release/deps/$name" "$target.new"
mv "$target.new" "$target"
