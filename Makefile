# make demo    the main job in its own environment: report and plots in out/demo
# make test    the fast tests
# make slow    the slow tests
# make lint    ruff and pyright
# make bench   the benchmarks in an environment with their peers, some 25 minutes;
#              BENCH_ARGS="asim --quick" for some of them or for rough figures
# make clean   remove the environments and the caches

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# two processes; the tests of one file stay together and share what they compile
PYTEST_ARGS ?= -n 2 --dist loadfile
BENCH_VENV := .venv-bench
BENCH_ARGS ?=

.PHONY: demo test slow lint bench clean

demo: $(VENV)/.core
	$(BIN)/elastax feedforward --out out/demo

test: $(VENV)/.test
	$(BIN)/python -m pytest $(PYTEST_ARGS)

# Status 5 of pytest: no test carries the mark. Their programs take longer to compile
# than to run, so with few optimisations; the fast tests compile as a user does.
slow: $(VENV)/.test
	JAX_DISABLE_MOST_OPTIMIZATIONS=1 \
	    $(BIN)/python -m pytest -m slow $(PYTEST_ARGS) || [ $$? -eq 5 ]

lint: $(VENV)/.test
	@echo "ruff check ..."
	@$(BIN)/ruff check .
	@echo "ruff format --check ..."
	@$(BIN)/ruff format --check .
	@echo "pyright elastax ..."
	@$(BIN)/pyright --pythonpath $(BIN)/python elastax

bench: $(BENCH_VENV)/.bench
	$(BENCH_VENV)/bin/python -m benchmarks $(BENCH_ARGS)

clean:
	rm -rf $(VENV) $(BENCH_VENV) .pytest_cache .ruff_cache .hypothesis

# The stamps are newer than what they were made from: a second run installs nothing.
$(VENV)/.created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "Python 3.11 or newer is needed: make PYTHON=python3.11 ..."; exit 1; }
	@echo "creating $(VENV) ..."
	@$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.core: pyproject.toml | $(VENV)/.created
	@echo "installing elastax and what it needs into $(VENV) (a few minutes) ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@touch $@

$(VENV)/.test: $(VENV)/.core
	@echo "installing the test tools into $(VENV) ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test]'
	@touch $@

$(BENCH_VENV)/.bench: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "Python 3.11 or newer is needed: make PYTHON=python3.11 ..."; exit 1; }
	@echo "installing elastax and its peers into $(BENCH_VENV) (a few minutes) ..."
	@$(PYTHON) -m venv $(BENCH_VENV)
	@echo '*' > $(BENCH_VENV)/.gitignore
	@$(BENCH_VENV)/bin/python -m pip install --quiet --disable-pip-version-check \
	    -e '.[bench]'
	@touch $@
