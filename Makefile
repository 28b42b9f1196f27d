# Everything runs in a virtual environment that these targets make.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo check test lint types fast unit clean

demo: $(STAMP)
	$(BIN)/scara-ident demo --output demo-output

# While working: three minutes. Before a change lands: everything.
check: lint types fast

test: lint types unit

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(STAMP)
	$(BIN)/mypy

fast: $(STAMP)
	$(BIN)/python -m pytest -n 2 -m "not slow"

unit: $(STAMP)
	$(BIN)/python -m pytest -n 2

$(STAMP): pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[test]"
	touch $@

clean:
	rm -rf $(VENV) demo-output build dist
