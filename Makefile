# Two commands are all one needs: `make demo` and `make test`. Both make their own virtual environment in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

FUZZ_SECONDS ?= 60

# What the compiled core is made of: an edit of it installs meshtide again, which compiles it.
CORE := $(shell find codec/core/src codec/core/include -type f) \
	$(addprefix codec/core/,CMakeLists.txt exports.map build_backend.py)
ZIG := $(shell sed -n 's/^ZIG = "\(.*\)"/\1/p' codec/core/build_backend.py)

.PHONY: demo test lint fuzz core-test core-sanitize core-aarch64 wasm clean
.DEFAULT_GOAL := demo

$(VENV)/demo.done: pyproject.toml $(CORE)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(VENV)/test.done: pyproject.toml $(CORE)
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

# The core alone, warnings as errors: its tests for each kind of processor and with plain lanes.
core-test:
	cd codec/core && cmake --preset test && cmake --build --preset test --parallel && ctest --preset test

core-sanitize: ## The same with clang++ and its sanitizers, then each fuzzer for a sixth of FUZZ_SECONDS.
	cd codec/core && CXX=clang++ cmake --preset sanitize && cmake --build --preset sanitize --parallel && ctest --preset sanitize
	set -e; for fuzzer in codec/core/fuzz/*.cpp; do name=$$(basename $$fuzzer .cpp); mkdir -p build/corpus/$$name; \
		build/core-sanitize/fuzz_$$name -max_total_time=$$(($(FUZZ_SECONDS) / 6)) -timeout=2 -rss_limit_mb=1024 \
		-verbosity=0 -artifact_prefix=build/corpus/ build/corpus/$$name; done

core-aarch64: ## The same for ARM's 64-bit processors, emulated.
	cd codec/core && cmake --preset aarch64 && cmake --build --preset aarch64 --parallel && ctest --preset aarch64

$(VENV)/zig.done: codec/core/build_backend.py
	$(PYTHON) -m venv $(VENV)/zig
	$(VENV)/zig/bin/python -m pip install --quiet $(ZIG)
	touch $@

wasm: $(VENV)/zig.done ## The core as WebAssembly, build/wasm/meshtide.wasm, and its tests in Node.
	cd codec/core && CXX="$(CURDIR)/$(VENV)/zig/bin/python -m ziglang c++" cmake --preset wasm && \
		cmake --build --preset wasm --parallel && ctest --preset wasm

clean: ## Remove the virtual environment and all caches.
	rm -rf $(VENV) build codec/meshtide_codec/libmeshtide_core_* .pytest_cache .mypy_cache .ruff_cache .hypothesis demo-output
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
