# The interpreter that .venv is made with: 3.11 or newer (make clean && make test PYTHON=python3.13).
PYTHON ?= python3
# Of the order that `make shuffle` runs the tests in.
SEED ?= 1

# Workers take tests from each other when they have none left; tests/conftest.py says how many.
PYTEST = .venv/bin/python -m pytest --numprocesses auto --dist worksteal
INSTALL = .venv/bin/python -m pip install --disable-pip-version-check -c constraints.txt
COMPILE = .venv/bin/python -m compileall -qq -j 0 .venv/lib || true

.DEFAULT_GOAL := help
.PHONY: help demo check test nightly shuffle gpu fuzz lint docs bench clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "make %-7s %s\n", $$1, $$2}' Makefile

demo: .venv/.demo  ## train on a maze and write the figures to runs/demo
	.venv/bin/python examples/train_curiosity_es.py --preset tuned --timesteps 1e7 --seed 0 --out runs/demo

check: lint  ## before a commit: lint, and the tests that are fast
	$(PYTEST) --fast

test: .venv/.installed  ## run the tests
	$(PYTEST)

nightly: fuzz  ## fuzz, and run the tests that are slow and rarely break
	$(PYTEST) --nightly

shuffle: .venv/.installed  ## run the tests in an order that SEED draws (make shuffle SEED=2)
	$(PYTEST) --shuffle $(SEED)

gpu: .venv/.installed  ## run the tests that need a GPU
	$(PYTEST) --gpu tests/algos/test_cuda.py

fuzz: .venv/.installed  ## run the property tests on examples drawn anew
	$(PYTEST) -m hypothesis --hypothesis-profile fuzz

lint: .venv/.installed  ## check style, types and dependencies
	.venv/bin/ruff check && .venv/bin/ruff format --check && .venv/bin/mypy --strict curiosity_gym curiosity_algos && .venv/bin/deptry .

docs: .venv/.installed  ## run examples and snippets, and build the documentation in docs/_build/html
	$(PYTEST) --pages tests/test_examples.py
	.venv/bin/sphinx-build -W --keep-going -b html docs docs/_build/html

bench: .venv/.bench  ## measure speed side by side with peers
	.venv/bin/python -m benchmarks.run

clean:  ## remove the environment, caches and built documentation
	rm -rf .venv .hypothesis .mypy_cache .pytest_cache .ruff_cache docs/_build

# The demo needs a fraction of what the tests do, which come on top.
# Compiled on all cores: pip does it on one, for half of its time. A file for a newer Python stays as it is.
.venv/.demo: pyproject.toml constraints.txt
	@echo "Installing the pinned dependencies of the demo into .venv: a minute or two."
	$(PYTHON) -m venv --clear .venv
	$(INSTALL) --no-compile -e ".[render]"
	@$(COMPILE)
	@touch $@

.venv/.installed: .venv/.demo
	@echo "Installing the pinned dependencies of the tests into .venv: several minutes the first time."
	$(INSTALL) --no-compile -e ".[dev]"
	@$(COMPILE)
	@touch $@

.venv/.bench: .venv/.installed
	$(INSTALL) -e ".[bench]"
	@touch $@
