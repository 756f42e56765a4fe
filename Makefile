# `make help` lists what can be made.

PYTHON ?= python3
PYTHONS ?= python3.12 python3.13
PARSING := $(addprefix tests/unit/,basics commands link mavlink mission)
VENV := .venv
BIN := $(VENV)/bin
RELEASE := $(VENV)-release/bin
MISSION ?= missions/circle-wind.yaml
OUT ?= flights/$(basename $(notdir $(MISSION)))

.PHONY: help fly test test-lint test-lockstep test-sockets test-containers test-live test-fast test-versions docs image release results tables sitl bench lint clean

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## /  make \1\t/p' $(MAKEFILE_LIST) | expand -t 24

fly: $(VENV)/.runtime ## sets up .venv and flies missions/circle-wind.yaml (or MISSION=...), report included
	$(BIN)/vfguide fly $(MISSION) --out $(OUT)

# tests/stages.py runs test-lint and test-lockstep beside the others: test-sockets with test-containers, then test-live.
test: $(VENV)/.dev ## lint and the whole test suite, as continuous integration runs it; a line a stage, output in test-logs/
	$(BIN)/python tests/stages.py

test-lint: $(VENV)/.dev
	+nice -n 19 $(MAKE) --no-print-directory lint

# Flights in lockstep take what processor is left, with the least priority.
test-lockstep: $(VENV)/.dev
	nice -n 19 $(BIN)/pytest -n 2 --dist loadscope --no-loadscope-reorder -m 'not real_time'

test-sockets: $(VENV)/.dev
	$(BIN)/pytest -m 'real_time and not live' tests/integration

# The image may be under way, and may be missing where there is no Docker engine: tests/docker says so.
test-containers: $(VENV)/.dev
	-tests/docker/make-image
	$(BIN)/pytest tests/docker

# Formations that fly in real time. Named are the places that have some: to look for more takes half a minute.
test-live: $(VENV)/.dev
	$(BIN)/pytest -n 2 --dist loadscope --no-loadscope-reorder -m live tests/autopilots tests/integration/console tests/integration/live

test-fast: $(VENV)/.dev ## the unit tests that fly nothing, in a minute
	$(BIN)/pytest -n auto -q -m 'not flies' tests/unit

# Tested whole are the oldest Python, by `make test`, and the newest; one between them could only differ in what it parses.
test-versions: ## test-fast on the last of PYTHONS="python3.12 python3.13", of it what parses on the others
	set -e; for python in $(PYTHONS); do \
	  place=$(VENV)-$$(basename $$python); \
	  $$python -m venv $$place; \
	  $$place/bin/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'; \
	  tests="$(PARSING)"; \
	  if [ $$python = $(lastword $(PYTHONS)) ]; then tests=tests/unit; fi; \
	  $$place/bin/pytest -n auto -q -m 'not flies' $$tests; \
	done

docs: $(VENV)/.dev ## the API pages from the sources, in site/
	$(BIN)/python docs/make_api.py site

image: ## the Docker image
	tests/docker/make-image

# From what is committed, stamped with its time: the same commit gives the same bytes, anywhere. Two environments of their own
# keep what builds and uploads out of what is developed with, and both out of the aircraft's install that the SBOM lists.
release: ## wheels and sdists of vfguide and sitl-stub in dist/, built twice and compared, checked, with an SBOM
	@test -z "$$(git status --porcelain)" || { echo "commit or remove what git status shows" >&2; exit 1; }
	rm -rf dist build $(VENV)-release $(VENV)-aircraft
	mkdir build
	$(PYTHON) -m venv $(VENV)-release
	$(RELEASE)/pip install --quiet --disable-pip-version-check --upgrade pip
	$(RELEASE)/pip install --quiet --group release
	export SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct); for place in dist build/again; do \
	  $(RELEASE)/python -m build --no-isolation --outdir $$place . && \
	  $(RELEASE)/python -m build --no-isolation --outdir $$place sitl_stub || exit 1; \
	done >build/release.log
	diff -r dist build/again
	$(RELEASE)/twine check --strict dist/*
	$(PYTHON) -m venv --without-pip $(VENV)-aircraft
	$(RELEASE)/pip --python $(VENV)-aircraft install --quiet --no-deps --no-index --find-links dist vfguide
	$(RELEASE)/pip --python $(VENV)-aircraft install --quiet --constraint constraints.txt vfguide
	SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) $(RELEASE)/cyclonedx-py environment --output-reproducible \
	  --output-file dist/vfguide.cdx.json $(VENV)-aircraft/bin/python
	cd dist && sha256sum * | tee SHA256SUMS

STUDIES ?=

results: $(VENV)/.dev ## measures what is cheap, or STUDIES="laws suite", and appends rows to docs/results
	nice $(BIN)/python -m tests.benchmarks.results measure $(STUDIES)

tables: $(VENV)/.dev ## writes the tables of README.md and docs/ from docs/results
	$(BIN)/python -m tests.benchmarks.results tables

sitl: $(VENV)/.runtime ## flies ArduPlanes and PX4s that you have built: docs/first-flight-sitl.md
	@test -n "$(ARDUPLANE)$(PX4)" || { echo "name what you have built: make sitl ARDUPLANE=PROGRAM PX4=PROGRAM" >&2; exit 1; }
ifneq ($(ARDUPLANE),)
	$(BIN)/python -m tests.autopilots.fly_sitl missions/ardupilot-sitl.yaml --binary $(ARDUPLANE) --wind 5,270
endif
ifneq ($(PX4),)
	$(BIN)/python -m tests.autopilots.fly_sitl missions/px4-sitl.yaml --program px4 --binary $(PX4)
endif

bench: $(VENV)/.runtime ## what a rehearsal costs, and where the time goes
	$(BIN)/python -m tests.benchmarks.lockstep_cost

lint: $(VENV)/.dev ## ruff, mypy and import-linter
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

$(VENV)/.runtime: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "vfguide needs Python 3.11 or newer; name one with: make PYTHON=python3.11")'
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "Python has no venv; on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[lab,files]'
	@touch $@

$(VENV)/.dev: $(VENV)/.runtime
	$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	@touch $@

clean: ## removes .venv, flights and caches
	rm -rf $(VENV) $(VENV)-* flights test-logs site build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
