# make fly   sets up .venv and flies missions/circle-wind.yaml to the end, report included
# make test  sets up .venv and runs the whole test suite
# make image makes the Docker image
# make accuracy flies the tables of docs/accuracy.md
# make live flies the article's missions live, 5 times as fast and in real time; takes ten minutes
# make sitl  flies formations of ArduPlanes and PX4s in software that you have built: docs/first-flight-sitl.md
# make bench measures what a rehearsal costs, and where the time goes

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
MISSION ?= missions/circle-wind.yaml
OUT ?= flights/$(basename $(notdir $(MISSION)))

.PHONY: fly test image accuracy live sitl bench lint clean

fly: $(VENV)/.runtime
	$(BIN)/vfguide fly $(MISSION) --out $(OUT)

# First what takes all of the processor, then what needs it in time, with nothing beside it that takes much. The image
# may be under way by then, and may be missing where there is no Docker engine: tests/docker says so.
test: lint
	$(BIN)/pytest -n 2 --maxschedchunk 1 -m 'not real_time'
	-tests/docker/make-image
	$(BIN)/pytest -n 2 --dist loadscope --no-loadscope-reorder -m real_time --ignore tests/docker
	$(BIN)/pytest tests/docker

image:
	tests/docker/make-image

accuracy: $(VENV)/.runtime
	$(BIN)/python tests/benchmarks/accuracy.py

live: $(VENV)/.runtime
	$(BIN)/python tests/benchmarks/live.py

sitl: $(VENV)/.runtime
	@test -n "$(ARDUPLANE)$(PX4)" || { echo "name what you have built: make sitl ARDUPLANE=PROGRAM PX4=PROGRAM" >&2; exit 1; }
ifneq ($(ARDUPLANE),)
	$(BIN)/python -m tests.autopilots.fly_sitl missions/ardupilot-sitl.yaml --binary $(ARDUPLANE) --wind 5,270
endif
ifneq ($(PX4),)
	$(BIN)/python -m tests.autopilots.fly_sitl missions/px4-sitl.yaml --program px4 --binary $(PX4)
endif

bench: $(VENV)/.runtime
	$(BIN)/python tests/benchmarks/lockstep_cost.py

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

$(VENV)/.runtime: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "vfguide needs Python 3.11 or newer; name one with: make PYTHON=python3.11")'
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "Python has no venv; on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable .
	@touch $@

$(VENV)/.dev: $(VENV)/.runtime
	$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) flights build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
