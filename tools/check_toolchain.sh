#!/bin/sh
# Is what set-up needs on this machine? One clear message for each thing that is missing or too old.
set -u
cd "$(dirname "$0")/.." || exit 1
python=${PYTHON:-python3}
rust_min=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
status=0

missing() { echo "set-up: $1" >&2; echo "        $2" >&2; status=1; }

if ! command -v "$python" >/dev/null 2>&1; then
    missing "$python is not there; Python 3.11 or newer is needed." "Debian: apt install python3 python3-venv; or say make PYTHON=/path/to/python3"
elif ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then
    missing "$("$python" --version) is too old; Python 3.11 or newer is needed to develop." "Say make PYTHON=/path/to/a/newer/python3"
elif ! "$python" -c 'import venv, ensurepip' >/dev/null 2>&1; then
    missing "$python cannot make a virtual environment (venv or ensurepip is missing)." "Debian: apt install python3-venv"
fi

if ! command -v cc >/dev/null 2>&1; then
    missing "no C compiler (cc); Rust needs one to link." "Debian: apt install gcc"
fi

if ! command -v cargo >/dev/null 2>&1; then
    missing "cargo is not there; Rust $rust_min or newer is needed." "Install it with rustup (the Rust project's installer) and open a new shell"
else
    rust=$(rustc --version | cut -d' ' -f2)
    oldest=$(printf '%s\n%s\n' "$rust_min" "$rust" | sort -V | head -n 1)
    if [ "$oldest" != "$rust_min" ]; then
        missing "Rust $rust is too old; $rust_min or newer is needed." "rustup update stable"
    fi
fi
exit $status
