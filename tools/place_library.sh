#!/usr/bin/env bash
# Puts the built library of FMUs and C programs into the package, in the place of an older one in one move.
set -euo pipefail
cd "$(dirname "$0")/.."
case $(uname -s) in
    Darwin) name=libpneudrive.dylib ;;
    *) name=libpneudrive.so ;;
esac
target=python/pneudrive/fmu/$name
cp "${CARGO_TARGET_DIR:-target}/release/$name" "$target.new"
mv "$target.new" "$target"
