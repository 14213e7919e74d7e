# Set up, check, measure. `make help` lists the targets.
#
# One virtual environment, VENV, holds what requirements/run.txt names and, where tests or checks
# are asked for, requirements/dev.txt on top (the same versions). Stamp files in it say what is
# done already.

PYTHON ?= python3
VENV ?= .venv
DEMO ?= demo
JOBS ?= 2

BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
# Prepared wheels only: nothing is compiled, and every file is checked against its hash.
LOCKED := $(PIP) install --quiet --require-hashes --only-binary :all: --requirement
# The build backend comes from the lock file too.
PACKAGE := $(PIP) install --quiet --no-deps --no-build-isolation --editable .
LOCK := $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --fork-strategy fewest \
	--generate-hashes --no-emit-index-url --custom-compile-command "make lock" pyproject.toml

# Two processes on two cores: a BLAS with threads of its own would only slow them down.
export OPENBLAS_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test accuracy lint format bench lock clean

help:  ## List the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' Makefile
	@echo "  PYTHON=python3.13 chooses the interpreter, VENV=.venv-3.13 the environment"

demo: $(VENV)/run.stamp  ## The main job on a simulated rig: pictures, calibration, lengths, report
	$(BIN)/sol demo $(DEMO)

test: $(VENV)/dev.stamp  ## All tests but the long statistics
	$(BIN)/python -m pytest --numprocesses $(JOBS) --quiet

accuracy: $(VENV)/dev.stamp  ## The long statistics over simulated calibrations
	$(BIN)/python -m pytest --numprocesses $(JOBS) -m accuracy tests

lint: $(VENV)/dev.stamp  ## Style, format, types, import contracts, versions
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports --no-logo
	$(PIP) check

format: $(VENV)/dev.stamp  ## Put the code into the house's format
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

bench: $(VENV)/dev.stamp  ## Speed and accuracy against peers and bounds
	@set -e; for name in $(filter-out _%,$(basename $(notdir $(wildcard bench/*.py)))); do \
		echo "== python -m bench.$$name"; $(BIN)/python -m bench.$$name; \
	done

lock: $(VENV)/dev.stamp  ## Renew requirements/ (needs a package index)
	$(LOCK) --upgrade --extra cluster --group dev --output-file requirements/dev.txt
	$(LOCK) --upgrade --group build --constraint requirements/dev.txt \
		--output-file requirements/run.txt

clean:  ## Remove environments, caches and the demo's output
	rm -rf .venv .venv-* build dist demo .pytest_cache .hypothesis .ruff_cache \
		.import_linter_cache .benchmarks
	find src tests bench -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/made.stamp:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "$(PYTHON) is $$($(PYTHON) --version 2>&1), Python 3.11 or newer is needed –" \
		"say which with make PYTHON=python3.11" >&2; exit 2; }
	@$(PYTHON) -c 'import ensurepip, venv' || { \
		echo "$(PYTHON) cannot make a virtual environment –" \
		"install its venv module (package python3-venv on Debian)" >&2; exit 2; }
	$(PYTHON) -m venv --clear $(VENV)
	@touch $@

$(VENV)/run.stamp: $(VENV)/made.stamp requirements/run.txt pyproject.toml
	$(LOCKED) requirements/run.txt
	$(PACKAGE)
	@touch $@

$(VENV)/dev.stamp: $(VENV)/run.stamp requirements/dev.txt
	$(LOCKED) requirements/dev.txt
	@touch $@
