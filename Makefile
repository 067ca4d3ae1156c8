# What a person does with this checkout. Needs Python >= 3.11 with venv, and make; the rest comes through pip.
PYTHON ?= python3
VENV ?= .venv
OUT ?= paper
WORKERS ?= 2
WORST ?= 15
FIGURES ?= speed motions counts operations compile long-chains agreement ensembles reconfiguration trust tightest hybrid

BIN = $(VENV)/bin
LOCKED = .venv-locked/bin
INSTALLED = $(VENV)/.installed-

.DEFAULT_GOAL := help
.NOTPARALLEL:  # two pips in one environment spoil it
.PHONY: help venv paper locked lock hooks test check coverage docs pictures bench clean

help:  ## this list
	@sed -n 's/^\([a-z]*\):.*## /\1	/p' Makefile | expand -t 10

venv: $(INSTALLED)all,test,check  ## the virtual environment, with all that the library uses and what tests and checks need

paper: $(INSTALLED)viz,mujoco  ## the paper's figures and tables, into OUT=paper
	$(BIN)/cgraph paper --out "$(OUT)"

locked: .venv-locked/.installed  ## the same, with the very packages of paper.lock, checked by their hashes
	$(LOCKED)/python -m viz paper --out "$(OUT)"

lock:  ## paper.lock anew, for all platforms, by uv (pip install uv)
	uv pip compile pyproject.toml --extra viz --extra mujoco --universal --generate-hashes --python-version 3.11 \
		--upgrade --quiet --custom-compile-command "make lock" --output-file paper.lock

hooks: $(INSTALLED)test,check  ## `make check` before every commit, by pre-commit
	$(BIN)/pre-commit install

test: $(INSTALLED)test  ## the tests, on WORKERS=2 processes; ARGS="-k name" or a path narrows them
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal $(ARGS)

check: $(INSTALLED)test,check  ## lint, format, types and the direction of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

coverage: $(INSTALLED)test  ## the lines that no test runs: the total, and the WORST=15 files with most of them
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal -q --timeout 600 --cov --cov-report= $(ARGS)
	@$(BIN)/python -m coverage report --skip-covered --sort=-miss | sed -n "1,$$(($(WORST) + 2))p"
	@$(BIN)/python -m coverage report --format=total | sed 's/.*/total: & % of all lines/'

docs: $(INSTALLED)docs,viz,mujoco  ## the documentation, into docs/_build/html
	$(BIN)/sphinx-build --fail-on-warning --keep-going -q docs docs/_build/html

pictures: $(INSTALLED)test  ## all pictures of the pages, from their examples and commands; ARGS=docs/gallery.md for one page
	$(BIN)/python -m tests.page_pictures $(ARGS)

bench: $(INSTALLED)bench  ## the comparisons with other software, hours; ARGS="counts --links 10" for one of them
	@$(if $(ARGS),$(BIN)/python -m tests.bench $(ARGS),for figure in $(FIGURES); do \
		echo "== $$figure"; $(BIN)/python -m tests.bench $$figure || exit 1; done)

clean:  ## remove the environments, paper and all else that the targets above make where nothing else is said
	rm -rf .venv .venv-locked paper docs/_build build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage

# One stamp for each set of extras, so that a second run installs nothing. The environment is kept when
# pyproject.toml changes; pip then brings it up to date.
$(INSTALLED)%: pyproject.toml | $(VENV)/.created
	@echo "Installing cgraph[$*] into $(VENV)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[$*]"
	@touch "$@"

$(VENV)/.created:
	$(PYTHON) -m venv "$(VENV)"
	@touch "$@"

.venv-locked/.installed: paper.lock
	$(PYTHON) -m venv --clear .venv-locked
	@$(LOCKED)/python -m pip install --quiet --disable-pip-version-check --require-hashes --requirement paper.lock
	@touch "$@"
