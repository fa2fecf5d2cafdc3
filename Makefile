# make demo    the main job in its own environment: report and plots in out/demo
# make test    the fast tests
# make slow    the slow tests
# make lint    ruff and pyright
# make clean   remove the environment and the caches

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# two processes; the tests of one file stay together and share what they compile
PYTEST_ARGS ?= -n 2 --dist loadfile

.PHONY: demo test slow lint clean

demo: $(VENV)/.core
	$(BIN)/elastax feedforward --out out/demo

test: $(VENV)/.test
	$(BIN)/python -m pytest $(PYTEST_ARGS)

# Status 5 of pytest: no test carries the mark.
slow: $(VENV)/.test
	$(BIN)/python -m pytest -m slow $(PYTEST_ARGS) || [ $$? -eq 5 ]

lint: $(VENV)/.test
	@echo "ruff check ..."
	@$(BIN)/ruff check .
	@echo "ruff format --check ..."
	@$(BIN)/ruff format --check .
	@echo "pyright elastax ..."
	@$(BIN)/pyright --pythonpath $(BIN)/python elastax

clean:
	rm -rf $(VENV) .pytest_cache .ruff_cache .hypothesis

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
