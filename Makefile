# `make demo` and `make test` are all a newcomer needs; both build .venv when it is missing or out of date.
PYTHON ?= python3
BIN := .venv/bin

.DEFAULT_GOAL := help
.PHONY: help venv demo test faults check fuzz format generate lock clean

help:  ## list the targets
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /\1\t/' | column -t -s '	'

.venv/run.stamp: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python >= 3.11 is needed, $(PYTHON) is $$($(PYTHON) --version 2>&1). Try: make PYTHON=python3.12 ..." >&2; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --editable .
	@touch $@

.venv/dev.stamp: pyproject.toml .venv/run.stamp
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

venv: .venv/dev.stamp  ## prepare .venv with everything, tests and development tools included

demo: .venv/run.stamp  ## fly the simulated team for two minutes, with live progress and a summary
	$(BIN)/arvi fly configs/lab.yaml

# What flies in real time has the machine to itself.
REAL_TIME := tests/system tests/interop

test: .venv/dev.stamp  ## run all tests
	$(BIN)/pytest -n auto --maxprocesses 4 --dist worksteal $(REAL_TIME:%=--ignore %)
	$(BIN)/pytest $(REAL_TIME)

faults: .venv/dev.stamp  ## fly the whole fault suite; writes docs/reliability.md
	$(BIN)/python -m sim_bridge.reliability --seeds 2 --moments 50 --bars 4 --write docs/reliability.md
	$(BIN)/pytest -m faults tests/faults

check: .venv/dev.stamp  ## lint, types, generated files up to date
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m onboard.protocol.generate --check
	$(BIN)/python -m onboard.flight.failsafes_page --check

RUNS ?= 20000

fuzz: .venv/dev.stamp  ## feed every target RUNS mutated inputs (20000); python -m fuzzing --help has more
	$(BIN)/python -m fuzzing --runs $(RUNS)

format: .venv/dev.stamp  ## format the code and mend what ruff can mend
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

generate: .venv/dev.stamp  ## write the generated files anew (MAVLink dialect, failsafes)
	$(BIN)/python -m onboard.protocol.generate
	$(BIN)/python -m onboard.flight.failsafes_page

lock: .venv/dev.stamp  ## pin anew, with hashes, what vehicles install (requirements/vehicle.lock)
	$(BIN)/pip install --quiet --disable-pip-version-check uv
	$(BIN)/uv pip compile requirements/vehicle.in --universal --python-version 3.11 --generate-hashes --no-annotate --quiet \
		--upgrade --custom-compile-command 'make lock' --output-file requirements/vehicle.lock

clean:  ## remove the virtual environment and all caches
	rm -rf .venv build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
