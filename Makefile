# Two commands are all one needs: `make demo` and `make test`. Both make their own virtual environment in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

FUZZ_SECONDS ?= 60

.PHONY: demo test lint fuzz clean
.DEFAULT_GOAL := demo

$(VENV)/demo.done: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(VENV)/test.done: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[test,bench,lab]'
	touch $@

demo: $(VENV)/demo.done ## Watch the Stanford bunny arrive over a websocket, coarse to fine.
	$(BIN)/meshtide demo --overwrite

lint: $(VENV)/test.done ## Linter, formatter and type checker.
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test: lint ## Linters, types and all tests.
	$(BIN)/pytest -n auto --dist loadfile

fuzz: $(VENV)/test.done ## Damaged files, streams, requests and messages, FUZZ_SECONDS of each.
	$(BIN)/python tests/bench/fuzz_mesh_files.py --seconds $(FUZZ_SECONDS)
	$(BIN)/python tests/bench/fuzz_streams.py --seconds $(FUZZ_SECONDS)
	$(BIN)/python tests/bench/load/fuzz_http.py --requests 0 --seconds $(FUZZ_SECONDS)
	$(BIN)/python tests/bench/load/fuzz_websocket.py --messages 0 --seconds $(FUZZ_SECONDS)

clean: ## Remove the virtual environment and all caches.
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis demo-output
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
