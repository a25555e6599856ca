#!/usr/bin/env bash
# Puts the library of FMUs and C programs into the package, stripped, in the place of an older one in one move.
set -euo pipefail
cd "$(dirname "$0")/.."
built=${CARGO_TARGET_DIR:-target}/release
case $(uname -s) in
    Darwin) name=libpneudrive.dylib strip=(strip -x) ;;
    *) name=libpneudrive.so strip=(strip --strip-unneeded) ;;
esac
target=python/pneudrive/fmu/$name
cp "$built/$name" "$target.new"
"${strip[@]}" "$target.new"
mv "$target.new" "$target"
