# Everything a new machine needs: python3 (3.11 to 3.13), pip, make. `make` lists the habits.
PYTHON ?= python3
BIN := .venv/bin
# A virtual environment without its own pip, filled by the pip outside it: works on a Debian without python3-venv.
PIP := $(PYTHON) -m pip --python $(BIN)/python --disable-pip-version-check -qq

.PHONY: help demo test lint types layers check bench lock clean
.DEFAULT_GOAL := help

help:  ## list the targets
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 12

demo: .venv/ready  ## play the shipped take: in a window, or into demo_out/ where there is no display
	@$(BIN)/sixpoint demo --out demo_out

test: .venv/ready-dev  ## run the tests
	@$(BIN)/python -m pytest -n auto --dist loadgroup

lint: .venv/ready-dev  ## style
	@$(BIN)/ruff check . && $(BIN)/ruff format --check .

types: .venv/ready-dev  ## types
	@$(BIN)/pyright

layers: .venv/ready-dev  ## imports run one way
	@$(BIN)/lint-imports

check: lint types layers test  ## all that must pass before anything lands

bench: .venv/ready-dev  ## speeds, as a table
	@$(BIN)/sixpoint bench all

lock:  ## resolve the dependencies anew (needs uv)
	uv pip compile pyproject.toml --group build --universal --python-version 3.11 --generate-hashes --no-annotate --no-header -q -o requirements.txt
	uv pip compile pyproject.toml --group dev --universal --python-version 3.11 --generate-hashes --no-annotate --no-header -q -o requirements-dev.txt

clean:  ## forget the environment and everything built
	rm -rf .venv build dist demo_out .pytest_cache .ruff_cache

.venv/ready: requirements.txt pyproject.toml
	@echo "installing sixpoint into .venv (once; some hundred megabytes)"
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' || { echo "sixpoint needs Python 3.11 to 3.13; try: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 2; }
	@test -x $(BIN)/python || $(PYTHON) -m venv --without-pip .venv
	@$(PIP) install --require-hashes -r requirements.txt
	@$(PIP) install --no-deps --no-build-isolation -e .
	@touch $@

.venv/ready-dev: .venv/ready requirements-dev.txt
	@$(PIP) install --require-hashes -r requirements-dev.txt
	@touch $@
