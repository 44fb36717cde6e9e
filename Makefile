# `make` alone lists what there is to do. Every target that needs the environment makes it first.
.DEFAULT_GOAL := help
.PHONY: help setup demo discover test test-all bench lint format types contracts docs check lock clean

BIN := .venv/bin
UV ?= uv
ARGS ?=

help:  ## this list
	@awk -F ':.*##' '/^[a-z]+:.*##/ { printf "  make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)
	@echo "  Arguments: make demo ARGS='--duration 10', make test ARGS='-k front_door'"

setup:  ## build the environment .venv from requirements.lock (idempotent)
	@tools/set_up.sh

demo: setup  ## scenario 1 in simulation as real ROS 2 nodes: recorded, verified, with a report
	@$(BIN)/haptic-teleop demo $(ARGS)

discover: setup  ## a robot with concealed physics: record, diagnose, open the label, simulate again (SEED=n)
	@$(BIN)/haptic-teleop discover --seed $(or $(SEED),1) $(ARGS)

# Many tests: on all cores, file by file, because a file's tests share what takes long to make, and in the order
# of tests/conftest.py. Some, named by ARGS: in one process, which begins sooner.
MANY_TESTS := -n auto --maxprocesses 8 --dist loadfile --no-loadscope-reorder --durations 25
# Hundreds of processes are started: what each of them would compile of Python is kept, whatever the shell says.
PYTEST := PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest

test: setup  ## the tests but for the longest (ten minutes on two cores), or what ARGS name
	@$(PYTEST) $(or $(ARGS),$(MANY_TESTS) -m 'not long')

test-all: setup  ## every test, as .ci/run does
	@$(PYTEST) $(MANY_TESTS) $(ARGS)

bench: setup  ## measure what the project promises about speed
	@$(BIN)/python tests/benchmarks/run.py $(ARGS)

lint: setup  ## style (ruff)
	@$(BIN)/ruff check .

format: setup  ## sort imports and put right what ruff can
	@$(BIN)/ruff check --fix .

types: setup  ## types of the pure code (pyright)
	@$(BIN)/pyright

contracts: setup  ## who may import whom (import-linter)
	@$(BIN)/lint-imports

docs: setup  ## the documentation site, into build/docs; a warning is an error
	@$(BIN)/sphinx-build -W --keep-going --quiet -d build/doctrees docs build/docs && echo "docs: open build/docs/index.html"

check: lint types contracts test-all docs  ## everything that must hold before a commit

lock:  ## pin dependencies anew after a change in pyproject.toml (needs uv on the PATH)
	@$(UV) pip compile --quiet --universal --python-version 3.11 --all-extras --generate-hashes \
		--no-emit-index-url --custom-compile-command "make lock" \
		--output-file requirements.lock pyproject.toml >/dev/null

clean:  ## remove the environment and everything that was generated
	rm -rf .venv build docs/generated install log output .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find src tests -name __pycache__ -prune -exec rm -rf {} +
