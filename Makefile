# Two commands do everything on a machine with Python 3.11 or later, git and make: `make report` and `make test`.
# PYTHON chooses the interpreter that .venv is made from: make test PYTHON=python3.12

VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
REPORT := report
NEW_ENOUGH := import sys; assert sys.version_info >= (3, 11)

# Each worker process compiles the kernels for itself (see tests/conftest.py), so more than a few of them do not pay.
TEST_WORKERS ?= auto
PYTEST_ARGS ?=

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
SHELL := /bin/sh

.PHONY: help setup kernels report quick test coverage check format lint imports types api-types clean distclean

help:
	@echo "make report   compare every solver on every scenario and write $(REPORT)/ (sets up $(VENV) when it is missing)"
	@echo "make quick    the same with fewer steps, for a first look"
	@echo "make test     run the tests (sets up $(VENV) when it is missing)"
	@echo "make check    formatting, linters, type checks and the direction of imports"
	@echo "make coverage which lines the tests reach"
	@echo "make setup    set up $(VENV), and bring it up to date when pyproject.toml or constraints.txt changed"
	@echo "make clean    remove reports, caches and build output;  make distclean  also removes $(VENV)"

# The last part of the set-up of a comparison: machine code for the line-up, kept until a kernel's source changes.
KERNELS_FROM = cat hqp_rp/core/kernels/*.py | cksum
kernels: setup
	@if [ "$$(cat $(VENV)/.kernels 2>/dev/null)" != "$$($(KERNELS_FROM))" ]; then \
	  echo "Compiling the kernels, once: a minute or two ..."; \
	  $(BIN)/python -c 'from hqp_rp.compare.contestants import default_contestants as line_up; from hqp_rp.compare.run import warm_up; warm_up(c.solver for c in line_up(limits=False))' && \
	  $(KERNELS_FROM) >$(VENV)/.kernels; \
	fi

report: kernels
	$(BIN)/hqp-rp compare --output $(REPORT) --overwrite
	@echo "The report is $(CURDIR)/$(REPORT)/report.html"

quick: kernels
	$(BIN)/hqp-rp compare --quick --output $(REPORT) --overwrite
	@echo "The report is $(CURDIR)/$(REPORT)/report.html"

# One thread for each worker: the problems are small, and workers that each start a pool of threads slow one another down.
test: export OMP_NUM_THREADS ?= 1
test: export OPENBLAS_NUM_THREADS ?= 1
test: setup
	$(BIN)/python -m pytest -n $(TEST_WORKERS) --maxprocesses 4 --dist worksteal $(PYTEST_ARGS)

# The kernels are machine code, whose lines nobody counts.
coverage: setup
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest $(PYTEST_ARGS)
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report

check: format lint imports types api-types

format: setup
	$(BIN)/ruff format --check .

lint: setup
	$(BIN)/ruff check .

imports: setup
	$(BIN)/lint-imports

types: setup
	$(BIN)/mypy

api-types: setup
	$(BIN)/basedpyright --pythonpath $(BIN)/python

# .installed says what the environment was made from: the requirements (by content, since a checkout changes dates) and
# the folder, whose path is written into the environment's scripts. An environment that is complete is left alone; one
# that is out of date is brought up to date; one that does not run, was moved here or is of another Python than the one
# that PYTHON asks for is made anew.
COMPLETE = $(BIN)/python -c 'import hqp_rp, pytest' >/dev/null 2>&1
PIP_INSTALL = $(BIN)/python -m pip install --quiet -c constraints.txt --config-settings editable_mode=compat -e ".[dev,humanoid]"
ASK = $(MAKE) --no-print-directory -s

setup:
	@made_from="$$(cat pyproject.toml constraints.txt | cksum) $(CURDIR)"; \
	if $(ASK) usable 2>/dev/null && [ "$$(cat $(STAMP) 2>/dev/null)" = "$$made_from" ] && $(COMPLETE); then exit 0; fi; \
	if $(ASK) usable 2>/dev/null; then echo "Bringing $(VENV) up to date ..."; else $(ASK) environment || exit 1; fi; \
	rm -f $(STAMP); $(PIP_INSTALL) || exit 1; \
	if ! $(COMPLETE); then $(ASK) environment && $(PIP_INSTALL) || exit 1; fi; \
	printf '%s\n' "$$made_from" >$(STAMP)

.PHONY: usable environment
usable:
	@grep -qsF "$(CURDIR)/$(VENV)" $(BIN)/activate && $(BIN)/python -c '$(NEW_ENOUGH); import pip' 2>/dev/null && \
	if [ -n "$$PYTHON" ]; then [ "$$($$PYTHON --version 2>&1)" = "$$($(BIN)/python --version)" ]; fi

environment:
	@for python in $${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do \
	  if "$$python" -c '$(NEW_ENOUGH)' >/dev/null 2>&1; then \
	    echo "Setting up $(VENV) with $$("$$python" --version): about 2 GB, some minutes ..."; \
	    rm -rf $(VENV); exec "$$python" -m venv $(VENV); \
	  fi; \
	done; \
	set -- $${PYTHON:-python3}; \
	echo "hqp_rp needs Python 3.11 or later, and $$1 is $$("$$1" --version 2>&1 | tail -n 1)." >&2; \
	echo "Install one, or name it: make test PYTHON=/path/to/python3.11" >&2; \
	exit 1

clean:
	rm -rf $(REPORT) runs build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .coverage .coverage.*
	find hqp_rp solvers scenarios tests -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV)
