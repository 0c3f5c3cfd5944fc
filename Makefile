# make demo: set up and run the main job on a real program. make test: set up and run every check.
# make studio: set up and open the studio on a blind exercise and a program.
# make docs: build the site. make dist: build the packages and try them.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PROGRAM ?= programs/pocket.nc

.PHONY: demo studio test lint house docs dist benchmark clean

demo: $(VENV)/.run
	$(BIN)/tps analyze $(PROGRAM) --out reports/demo --replace
	@echo "Report: $(CURDIR)/reports/demo/report.html"

# The case stays in reports/studio: a second call goes on where the first was left.
studio: $(VENV)/.run
	@if [ -f reports/studio/case.toml ]; then $(BIN)/tps studio --case reports/studio; \
	else $(BIN)/tps studio --case reports/studio --exercise 52 --program $(PROGRAM); fi

# One thread of linear algebra a process: the processes share the cores already. Each process takes a run of neighbouring
# tests, so that what the tests of a module share is computed once; who is done takes over from the others.
test: lint house
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist worksteal

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The budgets of .ci/house.toml, functions and types that runs pass among them.
house: $(VENV)/.dev
	$(BIN)/python .ci/house.py . --runs

docs: $(VENV)/.dev
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet --fresh-env -c docs -d docs/_build/doctrees . docs/_build/html
	@echo "Site: $(CURDIR)/docs/_build/html/index.html"

# Wheel and sdist; the wheel goes into an empty environment, where it must print what the README shows.
dist: $(VENV)/.dev
	rm -rf dist
	$(BIN)/python -m build --outdir dist
	$(PYTHON) -m venv dist/empty
	dist/empty/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl
	TPS=$(CURDIR)/dist/empty/bin/tps $(BIN)/python -m pytest tests/test_readme.py
	rm -rf dist/empty

benchmark: $(VENV)/.dev
	$(BIN)/python -m benchmarks

clean:
	rm -rf $(VENV) reports/demo docs/_build docs/api docs/commands build dist

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.run: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	touch $@

$(VENV)/.dev: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	touch $@ $(VENV)/.run
