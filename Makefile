# The only tools assumed: Python 3.11 or newer, pip and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUNS ?= runs

.PHONY: demo test test-lowest soak mutants lint guide clean

# Some systems' venv comes without ensurepip; pip itself then fills the environment.
# Installed editable into the project's own environment, so that `filters`, `aircraft` and `testbed`
# are this project's and nobody else's.
$(VENV)/.installed: pyproject.toml
	$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(0 if v >= (3, 11) else f"Python 3.11 or newer is needed, this is {v[0]}.{v[1]}; try make PYTHON=python3.12")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || $(PYTHON) -m venv --clear --without-pip $(VENV)
	$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m pip --python $(BIN)/python install --quiet pip
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

demo: $(VENV)/.installed
	$(BIN)/testbed compare paper-2-turn --out $(RUNS)/demo --overwrite

test: $(VENV)/.installed
	$(BIN)/python -m pytest --quiet -n auto --dist worksteal tests

# The oldest versions of the dependencies that are promised to work, in an environment of their own.
LOWEST := .venv-lowest
$(LOWEST)/.installed: pyproject.toml tests/lowest.txt
	test -x $(LOWEST)/bin/python || $(PYTHON) -m venv $(LOWEST) || $(PYTHON) -m venv --clear --without-pip $(LOWEST)
	$(LOWEST)/bin/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m pip --python $(LOWEST)/bin/python install --quiet pip
	$(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check --constraint tests/lowest.txt --editable '.[dev]'
	touch $@

# The tests through which every dependency is used.
LOWEST_TESTS := scenario run_files qp qp_solvers collision fleet fdm hostile faults_inside campaign_file export report versions
test-lowest: $(LOWEST)/.installed
	$(LOWEST)/bin/python -m pytest --quiet -n auto --dist worksteal -m 'not slow and not soak' \
	    $(LOWEST_TESTS:%=tests/test_%.py)

# Hours: 20,000 fuzz cases and 40,000 compositions of lying parts, 60 kills at random moments, an hour of twenty aircraft, two thousand runs.
soak: $(VENV)/.installed
	TESTBED_FUZZ=20 $(BIN)/python -m pytest --quiet -n auto --durations=0 tests/test_fuzz_scenario.py \
	    tests/test_fuzz_files.py tests/test_fuzz_cli.py tests/test_fuzz_parts.py tests/test_faults_around.py
	TESTBED_SOAK=1 $(BIN)/python -m pytest --quiet tests/test_guide.py -k every_command
	$(BIN)/python -m pytest --quiet -s -m soak tests/soak tests/test_verification_coverage.py

# Some hours on one core, resumable: is every change of filters/ and of the verdicts noticed by a test? Prints a
# table per file; the survivors are in runs/mutants/survivors.txt. FILES="filters/qp/single.py ..." for some of them.
mutants: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[mutation]'
	cd tests && ../$(BIN)/python -m mutation $(FILES)

lint: $(VENV)/.installed
	$(BIN)/ruff check filters aircraft testbed tests docs
	$(BIN)/ruff format --check --quiet filters aircraft testbed tests docs
	$(BIN)/mypy

# The pages and pictures of the guide that are generated.
guide: $(VENV)/.installed
	$(BIN)/testbed schema --markdown > docs/guide/scenarios.md
	$(BIN)/python docs/api_page.py > docs/guide/api.md
	$(BIN)/python docs/autopilot_page.py docs/guide/figures/blocks > docs/guide/loops.md
	$(BIN)/python docs/idea_figures.py docs/guide/figures

# Ratios within one run, some minutes; writes docs/guide/performance.md. Not part of pass or fail.
bench: $(VENV)/.installed
	cd tests && ../$(BIN)/python -m benchmarks

clean:
	rm -rf $(VENV) $(LOWEST) $(RUNS) build *.egg-info .pytest_cache .hypothesis .mypy_cache .ruff_cache
