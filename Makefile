# Two commands do everything on a machine with Python 3.11 or later, git and make: `make report` and `make test`.
# PYTHON chooses the interpreter that .venv is made from: make test PYTHON=python3.12

VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
REPORT := report
BENCH := bench
NEW_ENOUGH := import sys; assert sys.version_info >= (3, 11)

TEST_WORKERS ?= auto
PYTEST_ARGS ?=
BENCH_ARGS ?=

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
SHELL := /bin/sh

.PHONY: help setup report quick bench test coverage docs links core sanitize fuzz check format lint imports types api-types clean distclean

help:
	@echo "make report   compare every solver on every scenario and write $(REPORT)/ (sets up $(VENV) when it is missing)"
	@echo "make quick    the same with fewer steps, for a first look"
	@echo "make bench    time every solver beside its peers and write $(BENCH)/; BENCH_ARGS=\"--quick\" for options"
	@echo "make test     run the tests (sets up $(VENV) when it is missing)"
	@echo "make check    formatting, linters, type checks and the direction of imports"
	@echo "make coverage which lines the tests reach"
	@echo "make docs     these pages as a site, in build/docs; make links also visits every address outside"
	@echo "make core     the native core by itself: build, install for C++, build and run the example"
	@echo "make sanitize the solvers' tests with the native core under address and undefined-behaviour sanitizers"
	@echo "make fuzz     random and nasty problems against every solver's verdict, for a long time"
	@echo "make setup    set up $(VENV), and bring it up to date when pyproject.toml or constraints.txt changed"
	@echo "make clean    remove reports, caches and build output;  make distclean  also removes $(VENV)"

report: setup
	$(BIN)/hqp-rp compare --output $(REPORT) --overwrite
	@echo "The report is $(CURDIR)/$(REPORT)/report.html"

quick: setup
	$(BIN)/hqp-rp compare --quick --output $(REPORT) --overwrite
	@echo "The report is $(CURDIR)/$(REPORT)/report.html"

bench: setup
	$(BIN)/python -m tests.bench --output $(BENCH) $(BENCH_ARGS)

# One thread for each worker: the problems are small, and workers that each start a pool of threads slow one another down.
test: export OMP_NUM_THREADS ?= 1
test: export OPENBLAS_NUM_THREADS ?= 1
test: setup
	$(BIN)/python -m pytest -n $(TEST_WORKERS) --maxprocesses 4 --dist worksteal $(PYTEST_ARGS)

# The native core is C++, whose lines nobody counts here.
fuzz: setup
	$(BIN)/python -m tests.fuzz_verdicts --count 20000

coverage: setup
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest $(PYTEST_ARGS)
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report

# The site, offline: its code blocks run in the tests, its reference comes from the docstrings, and a warning is an error.
SPHINX = $(BIN)/python -m sphinx -q -W --keep-going -j auto -d build/doctrees
docs: setup
	$(SPHINX) -b html docs build/docs
	@echo "The pages are $(CURDIR)/build/docs/index.html"

links: setup
	$(SPHINX) -b linkcheck docs build/links

# The native core by itself: built, installed for C++, and an example built against that and run.
CORE := build/core
CMAKE = $(BIN)/cmake
core: setup
	@rm -rf $(CORE)
	$(CMAKE) -S hqp_rp/core/native -B $(CORE)/library -G Ninja -DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja >/dev/null
	$(CMAKE) --build $(CORE)/library >/dev/null
	$(CMAKE) --install $(CORE)/library --prefix $(CORE)/installed >/dev/null
	$(CMAKE) -S hqp_rp/core/native/examples -B $(CORE)/example -G Ninja -DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH=$(CURDIR)/$(CORE)/installed >/dev/null
	$(CMAKE) --build $(CORE)/example >/dev/null
	$(CORE)/example/control_loop

# The solvers' tests and the problem set with the core under address and undefined-behaviour sanitizers, in a copy of the tree.
SANITIZED := build/sanitized
sanitize: setup
	@rm -rf $(SANITIZED) && mkdir -p $(SANITIZED)/tree
	$(CMAKE) -S hqp_rp/core/native -B $(SANITIZED)/build -G Ninja -DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja -DHQP_RP_PYTHON=ON -DHQP_RP_SANITIZE=ON \
	  -DPython_EXECUTABLE=$(CURDIR)/$(BIN)/python -DCMAKE_BUILD_TYPE=Debug >/dev/null
	$(CMAKE) --build $(SANITIZED)/build >/dev/null
	@cp -R hqp_rp solvers scenarios tests docs pyproject.toml $(SANITIZED)/tree/ && rm -f $(SANITIZED)/tree/hqp_rp/core/_native*.so
	@cp $(SANITIZED)/build/_native*.so $(SANITIZED)/tree/hqp_rp/core/
	cd $(SANITIZED)/tree && LD_PRELOAD="$$(c++ -print-file-name=libasan.so) $$(c++ -print-file-name=libstdc++.so)" ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 \
	  $(CURDIR)/$(BIN)/python -m pytest -q -n 0 -p no:cacheprovider $(SANITIZE_TESTS)
SANITIZE_TESTS ?= tests/solvers tests/problem_set tests/core/test_verify.py tests/core/test_batch.py tests/core/test_workspace.py

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

# A machine without a C++ compiler takes one from PyPI: zig, as the wheel ziglang, behind two small scripts.
ZIG_CC = $(CURDIR)/$(VENV)/bin/zig-cc
ZIG_CXX = $(CURDIR)/$(VENV)/bin/zig-c++
COMPILER = if [ -n "$$CXX" ] || command -v c++ >/dev/null 2>&1 || command -v g++ >/dev/null 2>&1 || command -v clang++ >/dev/null 2>&1; then :; else \
	  echo "There is no C++ compiler here: taking zig from PyPI, about 80 MB ..."; \
	  $(BIN)/python -m pip install --quiet -c constraints.txt ziglang || exit 1; \
	  zig="$$($(BIN)/python -c 'import ziglang, pathlib; print(pathlib.Path(ziglang.__file__).with_name("zig"))')"; \
	  for tool in cc c++ ar ranlib; do \
	    printf '\#!/bin/sh\nexec "%s" %s "$$@"\n' "$$zig" $$tool >$(BIN)/zig-$$tool && chmod +x $(BIN)/zig-$$tool; \
	  done; \
	  export CC=$(ZIG_CC) CXX=$(ZIG_CXX) CMAKE_ARGS="-DCMAKE_AR=$(CURDIR)/$(BIN)/zig-ar -DCMAKE_RANLIB=$(CURDIR)/$(BIN)/zig-ranlib"; fi

# .installed says what the environment was made from: the requirements (by content, since a checkout changes dates) and
# the folder, whose path is written into the environment's scripts. An environment that is complete is left alone; one
# that is out of date is brought up to date; one that does not run, was moved here or is of another Python than the one
# that PYTHON asks for is made anew.
COMPLETE = $(BIN)/python -c 'import hqp_rp, pytest' >/dev/null 2>&1
PIP_INSTALL = $(BIN)/python -m pip install --quiet -c constraints.txt --config-settings editable_mode=compat -e ".[all,dev,docs]"
ASK = $(MAKE) --no-print-directory -s

setup:
	@made_from="$$(cat pyproject.toml constraints.txt $$(find hqp_rp/core/native -type f | sort) | cksum) $(CURDIR)"; \
	if $(ASK) usable 2>/dev/null && [ "$$(cat $(STAMP) 2>/dev/null)" = "$$made_from" ] && $(COMPLETE); then exit 0; fi; \
	if $(ASK) usable 2>/dev/null; then echo "Bringing $(VENV) up to date ..."; else $(ASK) environment || exit 1; fi; \
	rm -f $(STAMP); $(COMPILER); $(PIP_INSTALL) || exit 1; \
	if ! $(COMPLETE); then $(ASK) environment && $(PIP_INSTALL) || exit 1; fi; \
	printf '%s\n' "$$made_from" >$(STAMP)

.PHONY: usable environment
usable:
	@grep -qsF "$(CURDIR)/$(VENV)" $(BIN)/activate && $(BIN)/python -c '$(NEW_ENOUGH); import pip' 2>/dev/null && \
	if [ -n "$$PYTHON" ]; then [ "$$($$PYTHON --version 2>&1)" = "$$($(BIN)/python --version)" ]; fi

environment:
	@for python in $${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do \
	  if "$$python" -c '$(NEW_ENOUGH)' >/dev/null 2>&1; then \
	    echo "Setting up $(VENV) with $$("$$python" --version): about 1.7 GB, some minutes ..."; \
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
