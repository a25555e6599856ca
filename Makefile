# The only door. Every target sets up what it needs; only the first one pays for it.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help
MAKEFLAGS += --no-builtin-rules

PYTHON ?= python3
VENV := .venv
EXTRAS := .venv-extras
BIN := $(VENV)/bin
PY := $(BIN)/python
UV := $(BIN)/uv pip install --quiet --compile-bytecode --python $(PY) --require-hashes

# One interpreter for every cargo run, or PyO3 would be built again for each.
export PYO3_PYTHON := $(CURDIR)/$(VENV)/bin/python
export MATURIN_NO_INSTALL_RUST := 1
# Byte code is kept: without it each worker of the tests rewrites their asserts anew, for 6 s.
unexport PYTHONDONTWRITEBYTECODE

RUST := Cargo.toml Cargo.lock $(wildcard .cargo/config.toml) \
        $(shell find crates \( -name '*.rs' -o -name Cargo.toml \) -not -path '*/tests/*' -not -path '*/benches/*')
PAGE := $(wildcard page/*.json page/*.ts page/index.html page/src/* page/src/*/* page/public/*) tools/page.py
# More than two cores have: some tests wait for a process that they killed, or for a browser.
PYTEST_WORKERS ?= 3

.PHONY: help setup demo test test-rust test-python test-page trials test-extras check real bench record docs wheel test-wheel fmt lock

help:  ## this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## */\1\t/' | awk -F '\t' '{printf "  make %-11s %s\n", $$1, $$2}'

setup: $(VENV)/.core $(VENV)/.built  ## .venv with locked dependencies, the compiled core, the page and the pneudrive command

demo: setup  ## real recordings, a simulated rig, a controlled axis: friction map, fit, stick-slip, one report
	@$(BIN)/pneudrive demo

# The browser's tests among Python's: while they wait, others run.
test: test-rust $(VENV)/.page  ## all tests
	$(PY) -m pytest -n $(PYTEST_WORKERS) --ignore=tests/documentation

# Of the release build, which `make setup` has made but for the tests themselves.
test-rust: setup
	cargo test --release --workspace --locked --tests

test-python: setup
	$(PY) -m pytest -n $(PYTEST_WORKERS) --ignore=tests/page --ignore=tests/documentation

test-page: setup $(VENV)/.page  ## the page in a browser: PNEUDRIVE_CHROMIUM, else one on the path, else that of page/browser's lock
	$(PY) -m pytest -n $(PYTEST_WORKERS) tests/page

COUNT ?= 10000
SEED ?= 1
trials: setup  ## long random trials from SEED=1, COUNT=10000 drives, circuits, foreign files; fewer of what takes longer
	$(PY) -m trials.random_runs --count $(COUNT) --seed $(SEED)
	$(PY) -m trials.random_circuits --count $(COUNT) --seed $(SEED)
	$(PY) -m trials.foreign_trials --count $(COUNT) --seed $(SEED)
	$(PY) -m trials.random_drives --count $$(( $(COUNT) / 100 )) --seed $(SEED)
	$(PY) -m trials.random_drives --remembers --count $$(( $(COUNT) / 200 )) --seed $(SEED)
	$(PY) -m trials.fit_coverage --count $$(( $(COUNT) / 10 )) --seed $(SEED)
	$(PY) -m trials.circuit_coverage --count $$(( $(COUNT) / 200 )) --seed $(SEED)
	$(PY) -m trials.chain_coverage --count $$(( $(COUNT) / 100 )) --seed $(SEED)
	$(PY) -m trials.campaign_coverage --count $$(( $(COUNT) / 50 )) --seed $(SEED)
	$(PY) -m trials.hidden_truths --count $$(( $(COUNT) / 100 )) --first $(SEED)
	$(PY) -m trials.campaign_comparisons --count $$(( $(COUNT) / 50 )) --seed $(SEED)
	$(PY) -m trials.stop_coverage --count $$(( $(COUNT) / 100 )) --seed $(SEED)
	$(PY) -m trials.diagnosis_hits --count $$(( $(COUNT) / 1000 )) --seed $(SEED)
	$(PY) -m trials.profile_coverage drives --count $$(( $(COUNT) / 250 )) --first $(SEED)
	$(PY) -m trials.profile_coverage tubes --count $$(( $(COUNT) / 250 )) --first $(SEED)
	$(PY) -m trials.sizing_enumerated --count $$(( $(COUNT) / 200 )) --seed $(SEED)
	PNEUDRIVE_DAMAGED=$(COUNT) $(PY) -m pytest -q tests/acceptance/test_damaged_files.py
	PNEUDRIVE_KILLS=$$(( $(COUNT) / 100 )) $(PY) -m pytest -q tests/campaign/test_killed.py

test-extras: setup $(EXTRAS)/.deps  ## a Dask cluster whose workers are killed, JAX, PyTorch, MuJoCo; in an environment of its own
	PYTHONPATH=python $(EXTRAS)/bin/python -m pytest --confcutdir=tests/extras tests/extras

check: setup  ## what CI runs before the tests: format, lint, types, layers, repetition, stub, spelling, locks
	cargo fmt --all --check
	cargo clippy --release --workspace --all-targets --locked --quiet -- -D warnings
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/basedpyright
	PYTHONPATH=python $(BIN)/lint-imports
	$(PY) tools/measure.py --check
	MYPYPATH=python $(PY) -m mypy.stubtest pneudrive._core --concise --ignore-disjoint-bases
	$(BIN)/typos
	$(PY) tools/lock.py --check
	$(PY) tools/stubs.py --check
	$(PY) tools/page.py check

real: setup  ## docs/theory/how-well.md and its figures, from the real recordings in data/measurements
	$(PY) tools/real_drives.py

bench: setup $(VENV)/.bench $(VENV)/.page $(if $(shell command -v gfortran),$(VENV)/.fortran)  ## work counts and seconds, side by side with other solvers
	$(PY) -m benches

record: setup  ## the figures of the last bench become those of README and the documentation
	$(PY) -m benches.record

docs: setup $(VENV)/.docs $(VENV)/.page  ## the documentation, into docs/_build/html, its cells, commands and examples executed; opened in a browser
	$(PY) -m sphinx --fail-on-warning --quiet -b html docs docs/_build/html
	$(PY) -m pytest -q tests/documentation
	@echo "docs/_build/html/index.html"

wheel: setup  ## a wheel with core and page in it, into out/wheels
	$(PY) tools/wheel.py build

test-wheel: wheel  ## the wheel in an empty environment, without Rust and node: the demo, the page, an FMU
	$(PY) tools/wheel.py try

fmt: setup  ## format Rust, Python and the page, apply what ruff and biome can repair
	cargo fmt --all
	$(PY) tools/page.py format
	$(BIN)/ruff check --fix --quiet . || true
	$(BIN)/ruff format .

lock: $(VENV)/.uv  ## renew requirements/*.txt from pyproject.toml
	$(PY) tools/lock.py

# --- set-up, each step once ------------------------------------------------------------------
# A stamp carries the time at which its step began: a file that changes meanwhile is newer.

$(VENV)/.uv: requirements/bootstrap.txt
	@PYTHON=$(PYTHON) tools/check_toolchain.sh
	$(PYTHON) -m venv $(VENV)
	$(PY) -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements/bootstrap.txt
	@touch $@

$(VENV)/.deps: requirements/dev.txt $(VENV)/.uv
	@touch $@.new
	$(UV) -r requirements/dev.txt
	@mv $@.new $@

$(VENV)/.core: $(RUST) pyproject.toml $(VENV)/.deps
	@PYTHON=$(PYTHON) tools/check_toolchain.sh
	@touch $@.new
	$(BIN)/maturin develop --release --uv --quiet
	@tools/fmu_library.sh
	@$(PY) -m compileall -q python/pneudrive
	@mv $@.new $@

$(VENV)/.built: $(PAGE) $(VENV)/.deps
	@touch $@.new
	$(PY) tools/page.py build
	@mv $@.new $@

$(EXTRAS)/.deps: requirements/extras.txt $(VENV)/.deps
	$(BIN)/uv venv --quiet --clear --python $(PY) $(EXTRAS)
	$(BIN)/uv pip install --quiet --python $(EXTRAS)/bin/python --require-hashes -r $<
	@touch $@

$(VENV)/.%: requirements/%.txt $(VENV)/.deps
	$(UV) -r $<
	@touch $@
