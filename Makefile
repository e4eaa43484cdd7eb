PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV   ?= .venv
BIN     = $(VENV)/bin
STAMP   = $(VENV)/.installed

.PHONY: help demo test verify lint clean

help:
	@echo "make demo    three robots map a hall of 24 tags, three minutes"
	@echo "make test    the test suite with seeded samples of the figures"
	@echo "make verify  every figure of every benchmark in full"
	@echo "make lint    ruff and mypy"
	@echo "make clean   remove the virtual environment"

$(STAMP): pyproject.toml deploy/constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "tagmap needs Python 3.11 or newer, found %s; set PYTHON=..." % sys.version.split()[0])'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c deploy/constraints.txt -e '.[dev]'
	-$(BIN)/python -m fleet.running.kernels
	@touch $@

demo: $(STAMP)
	$(BIN)/fleet demo

test: $(STAMP)
	$(BIN)/python -m pytest -m "not slow" --numprocesses 2 --dist loadfile

verify: $(STAMP)
	$(BIN)/python -m pytest -m slow

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

clean:
	rm -rf $(VENV)
