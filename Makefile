# `make help` lists what there is. PYTHON names the Python (3.11 or newer) that the environment
# is made of: make demo PYTHON=python3.12

PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin

# Without a C compiler on PATH (or in the environment variable CC), the one in ziglang is installed.
NATIVE_CC := $(shell command -v cc 2>/dev/null || command -v gcc 2>/dev/null || command -v clang 2>/dev/null)
ifneq ($(origin CC),default)
NATIVE_CC := $(CC)
endif
ifeq ($(strip $(NATIVE_CC)),)
CROSS := ,cross
endif

OTHER_KERNELS := tests/solvers/test_shortest_steps.py tests/solvers/test_partial_ldl.py \
    tests/loops/test_configuration.py tests/robots/test_benchmarks_pendulum.py \
    tests/simulate/test_over_constrained.py \
    tests/bridges/test_opti.py::test_four_bar_finds_its_optimum \
    tests/identification/exciting/test_excitation.py::test_a_platform_that_follows_keeps_its_height \
    tests/models/inverse_geometry/test_families.py::test_a_shoulder_singularity_turns_all_the_way_round

# What needs no compiler, no browser and no long motion.
FAST := tests/assembly tests/components tests/formats tests/operations \
    tests/recursions tests/spatial tests/test_expressions.py tests/structure/test_class_names.py \
    tests/structure/test_number_reasons.py tests/view

C_FILES := $(wildcard mbs/core/source/*.[ch] mbs/export/c/*.c mbs/export/fmu/c/*.[ch] mbs/native/runtime/*.[ch])

INSTALL := $(RUN)/python -m pip install --quiet --disable-pip-version-check --editable

LOWEST := build/lowest/bin/python

.PHONY: help demo check test test-all test-lowest guides kernels kernels-short lint types layers docs clean

help:
	@echo "make demo     install mbs into $(VENV) and run examples/01_four_bar.py; files go to build/four_bar"
	@echo "make check    lint, types, layers and the fast half of the tests"
	@echo "make test     install the tools and run every check: lint, types, layers, tests; of sweeps a part, no slow tests"
	@echo "make test-all the same with every case of every sweep and slow tests, and make guides"
	@echo "make guides   every page in the installation that it documents, in build/guides"
	@echo "make test-lowest  the tests with the lowest versions that pyproject.toml allows, in build/lowest; Python 3.11 or 3.12"
	@echo "make kernels  the tests of numerical subjects as other processors compute; SETTINGS names some"
	@echo "make kernels-short  a part of them under one kernel"
	@echo "make lint     ruff and clang-format: style and format"
	@echo "make types    mypy, strict"
	@echo "make layers   import-linter: no module imports a higher layer"
	@echo "make docs     build the documentation into build/docs; a warning is an error"
	@echo "make clean    remove build/, caches and $(VENV)"
	@echo "PYTHON=...    the Python to make $(VENV) of, 3.11 or newer (now: $(PYTHON))"

demo: $(VENV)/.demo
	@$(RUN)/python examples/01_four_bar.py build/four_bar

test: lint types layers
	@$(RUN)/python -m pytest -n 2 --dist worksteal

check: lint types layers
	@$(RUN)/python -m pytest -n 2 --dist worksteal $(FAST)

test-all: lint types layers
	@MBS_TEST_ALL=1 $(RUN)/python -m pytest -n 2 --dist worksteal
	@$(MAKE) --no-print-directory guides

guides: $(VENV)/.dev
	@$(RUN)/python .ci/guides

# Old packages say that newer ones, on which they stand, have deprecated something: no error here.
test-lowest: build/lowest/.made
	@$(LOWEST) -m pytest -n 2 --dist worksteal -W default::DeprecationWarning $(TESTS)

build/lowest/.made: pyproject.toml .ci/lowest
	$(PYTHON) -m venv --clear build/lowest
	@$(LOWEST) .ci/lowest dev cross tables > build/lowest/versions.txt
	$(LOWEST) -m pip install --quiet --disable-pip-version-check --only-binary :all: \
	  --constraint build/lowest/versions.txt --editable ".[dev,cross,tables]"
	@touch $@

# The tests of numerical subjects as other processors compute: some settings are chosen by
# make kernels SETTINGS="Haswell x86-64-v3".
kernels: $(VENV)/.dev
	@$(RUN)/python .ci/kernels $(SETTINGS)

# A part of them under one kernel.
kernels-short: $(VENV)/.dev
	@$(RUN)/python benchmarks/fingerprint.py --kernels Nehalem Zen --threads 1
	@OPENBLAS_CORETYPE=Nehalem $(RUN)/python -m pytest -n 2 --dist worksteal $(OTHER_KERNELS)

lint: $(VENV)/.dev
	@$(RUN)/ruff check .
	@$(RUN)/ruff format --check .
	@$(RUN)/clang-format --dry-run --Werror $(C_FILES)

types: $(VENV)/.dev
	@$(RUN)/mypy

layers: $(VENV)/.dev
	@$(RUN)/lint-imports

docs: $(VENV)/.dev
	@$(RUN)/sphinx-build -q -W --keep-going -j auto -b html -d build/doctrees docs build/docs
	@echo "Documentation in build/docs/index.html"

clean:
	rm -rf build dist $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache

$(VENV)/.python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "$(PYTHON) is not Python 3.11 or newer; run make with PYTHON=python3.12, for example"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.demo: pyproject.toml $(VENV)/.python
	$(INSTALL) ".[plot$(CROSS)]"
	@touch $@

$(VENV)/.dev: pyproject.toml $(VENV)/.python
	$(INSTALL) ".[dev$(CROSS)]"
	@touch $(VENV)/.demo $@
