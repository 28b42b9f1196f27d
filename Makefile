# Everything runs in a virtual environment that these targets make.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo check test lint types compiled fast unit bench clean

demo: $(STAMP)
	$(BIN)/scara-ident demo --output demo-output

# While working: one to two minutes. Before a change lands: everything.
check: lint types fast

# Types are checked beside the rest: alone they would leave a core idle for most of a minute.
test: $(STAMP)
	$(MAKE) --no-print-directory lint
	$(MAKE) --no-print-directory -j 2 types unit

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(STAMP)
	$(BIN)/mypy

# The virtual arm's loop, once, so that workers need not each compile it.
compiled: $(STAMP)
	$(BIN)/python -c "from scara_ident import *; arm = virtual_arm(); simulate(arm, named_motion('OJD', arm.robot), rate=250.0)"

# Three workers share two cores, as tests wait for browsers, servers and processes; a second BLAS thread of each would only
# wait for the others'. Commands that tests run keep what they compile: each would compile all modules again.
PYTEST := PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 3

fast: $(STAMP)
	$(PYTEST) --dist worksteal -m "not slow"

unit: $(STAMP) compiled
	$(PYTEST) --dist worksteal

# Speed, beside figaroh in an environment of its own; writes docs/benchmarks.md.
FIGAROH := build/figaroh

bench: $(STAMP) $(FIGAROH)/.installed
	$(BIN)/python benchmarks/bench.py --figaroh $(FIGAROH)/bin/python

$(FIGAROH)/.installed:
	test -x $(FIGAROH)/bin/python || $(PYTHON) -m venv $(FIGAROH)
	$(FIGAROH)/bin/python -m pip install --quiet --disable-pip-version-check figaroh==1.0.2
	touch $@

$(STAMP): pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[test]"
	touch $@

clean:
	rm -rf $(VENV) demo-output build dist
