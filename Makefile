# Everything a developer runs. `make` or `make help` lists the targets; the first one used sets the clone up.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
BIN := .venv/bin
PYTEST_ARGS ?=
WORKERS ?= 3 # processes that run tests; most of the time they wait for others

.DEFAULT_GOAL := help
.PHONY: help setup setup-core test lint unit format coverage demo bench budgets docs-check changelog build clean distclean

help: ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ## Create .venv and install everything the checks need (quick when nothing changed)
	@$(if $(READY),,tools/setup.sh)

test: setup ## Everything: lint, types, layers, all tests on CPython and MicroPython
	@failed=; for part in lint unit; do $(MAKE) --no-print-directory READY=1 $$part || failed+=" $$part"; done; \
	if [ "$$failed" ]; then echo "make test: failed in:$$failed" >&2; exit 1; fi

lint: setup ## Style, formatting, types and the order of the rooms
	@failed=; run() { echo "== $$*"; $(BIN)/"$$@" || failed=1; }; \
	run ruff check --quiet --output-format concise .; \
	run ruff format --quiet --check --output-format concise .; run mypy --no-error-summary $(wildcard src tests tools bench examples); \
	run lint-imports --no-logo; test -z "$$failed"

unit: setup ## All tests (PYTEST_ARGS="tests/xrce -k stream" chooses)
	@echo "== pytest" && $(BIN)/pytest -n $(WORKERS) --dist loadfile $(PYTEST_ARGS)

format: setup ## Let ruff mend style and formatting
	@$(BIN)/ruff check --quiet --fix . ; $(BIN)/ruff format --quiet .

coverage: setup ## All tests with line and branch coverage
	@$(BIN)/pytest --cov --cov-report=term $(PYTEST_ARGS)

setup-core: ## Create .venv alone, without what only tests need
	@tools/setup.sh core

demo: setup-core ## Boards and an agent in the ROS 2 graph, in one terminal
	@$(BIN)/python examples/demo.py

bench: setup ## Every benchmark in bench/
	@for script in bench/bench_*.py; do echo "== $$script" && $(BIN)/python "$$script" || exit 1; done

budgets: setup ## What the board floor costs in heap, flash and instructions, beside its budgets
	@$(BIN)/python tools/budgets.py

docs-check: setup ## Links inside the documentation, and that each changelog fragment is well-formed
	@$(BIN)/pytest -q tests/test_documents.py

changelog: setup ## Show what the next release's changelog will say
	@$(BIN)/towncrier build --draft --version next

build: setup ## Wheel and source archive into dist/
	@$(BIN)/hatchling build

clean: ## Remove caches and built files, keep .venv
	@rm -rf build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache .coverage
	@find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean ## Remove .venv too
	@rm -rf .venv
