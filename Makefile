# Nothing here needs an activated environment. PYTHON chooses the interpreter for a new one.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

INSTRUCTION ?= A vehicle yields to a pedestrian at 8 am
SEED ?= 7
OUT ?= scenes/demo

.DEFAULT_GOAL := demo
.PHONY: demo test lint format bench check

demo: $(INSTALLED)
	$(BIN)/scenewright make "$(INSTRUCTION)" --seed $(SEED) --out $(OUT)

test: $(INSTALLED)
	$(BIN)/pytest

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --strict
	$(BIN)/lint-imports

format: $(INSTALLED)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(INSTALLED)
	set -e; for script in $(sort $(wildcard benchmarks/[!_]*.py)); do echo "== $$script"; $(BIN)/python "$$script"; done

check: lint test

$(INSTALLED): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo 'Installing into $(VENV), about 2 GB ...'
	$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@
