# boresight: set up, run the sample, test. Needs Python 3.11 or 3.12 and nothing else.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# Measuring coverage takes about an eighth of the processor time; `make test COVERAGE=` leaves it out.
COVERAGE := --cov --cov-report=term:skip-covered

# Compiled modules are kept even where Python is told not to: each of the many programs that tests start would
# compile all of them again, a second of processor time each.
test: export PYTHONDONTWRITEBYTECODE :=

.PHONY: setup run test docs lock clean

setup: $(READY)

# The lock names everything: resolved again, an extra of a package would ask for its newest version.
$(READY): requirements.lock pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --require-hashes --no-deps -r requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	touch $(READY)

run: setup
	$(BIN)/boresight run data/sample -o runs/sample

test: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	# Beside the types, on the other core, loops are compiled once: tests in two processes would each do it.
	$(BIN)/mypy & types=$$!; $(BIN)/python -m tests.compiled; compiled=$$?; wait $$types && exit $$compiled
	$(BIN)/pytest --numprocesses=2 --dist=loadfile --no-loadscope-reorder --durations=30 $(COVERAGE)

# The pages of `import boresight`, into build/docs.
docs: setup
	$(BIN)/pdoc --docformat numpy --output-directory build/docs boresight

# The lock holds exact versions and hashes for every platform; run this after a change of pyproject.toml.
lock:
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-annotate --no-header \
	  --extra dev --output-file requirements.lock pyproject.toml

clean:
	rm -rf $(VENV) build *.egg-info
