# Two commands are all one needs: `make demo` and `make test`. Both make their own virtual environment in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

FUZZ_SECONDS ?= 60
JOBS := $(shell getconf _NPROCESSORS_ONLN)

# What the compiled core is made of: an edit of it installs meshtide again, which compiles it.
CORE := $(shell find codec/core/src codec/core/include -type f) \
	$(addprefix codec/core/,CMakeLists.txt exports.map build_backend.py)
ZIG := $(shell sed -n 's/^ZIG = "\(.*\)"/\1/p' codec/core/build_backend.py)

.PHONY: demo test lint fuzz core-test core-work core-sanitize core-aarch64 core-train wasm web clean
.DEFAULT_GOAL := demo

$(VENV)/demo.done: pyproject.toml $(CORE)
	@echo "Installing meshtide into $(VENV): the C++ core is compiled, which takes a minute or two, with Zig's compiler longer."
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
	$(BIN)/mypy tests/bench tools
	$(BIN)/lint-imports --no-logo

test: lint ## Linters, types and all tests.
	$(BIN)/pytest -n auto --dist loadfile

fuzz: $(VENV)/test.done ## Damaged files, streams, requests and messages, FUZZ_SECONDS of each.
	$(BIN)/python tests/bench/fuzz_mesh_files.py --seconds $(FUZZ_SECONDS)
	$(BIN)/python tests/bench/fuzz_streams.py --seconds $(FUZZ_SECONDS)
	$(BIN)/python tests/bench/load/fuzz_http.py --requests 0 --seconds $(FUZZ_SECONDS)
	$(BIN)/python tests/bench/load/fuzz_websocket.py --messages 0 --seconds $(FUZZ_SECONDS)

# The core alone, warnings as errors: its tests for each kind of processor and with plain lanes.
core-test:
	cd codec/core && cmake --preset test && cmake --build --preset test --parallel $(JOBS) && ctest --preset test

core-work: core-test $(VENV)/test.done ## Instructions of decoding and encoding a shipped mesh, against stored numbers.
	$(BIN)/python tests/bench/work.py build/core-test/core_work

core-sanitize: ## The same with clang++ and its sanitizers, then each fuzzer for a sixth of FUZZ_SECONDS, from the golden streams on.
	cd codec/core && CXX=clang++ cmake --preset sanitize && cmake --build --preset sanitize --parallel $(JOBS) && ctest --preset sanitize
	$(PYTHON) tools/make_corpus.py build/corpus
	set -e; for fuzzer in codec/core/fuzz/*.cpp; do name=$$(basename $$fuzzer .cpp); \
		build/core-sanitize/fuzz_$$name -max_total_time=$$(($(FUZZ_SECONDS) / 6)) -timeout=2 -rss_limit_mb=1024 \
		-verbosity=0 -artifact_prefix=build/corpus/ build/corpus/$$name; done

core-aarch64: ## The same for ARM's 64-bit processors, emulated.
	cd codec/core && cmake --preset aarch64 && cmake --build --preset aarch64 --parallel $(JOBS) && ctest --preset aarch64

core-train: ## Train the states of both efforts and of profile classic on MESHES (bench/training.cpp lists them); prints sizes of those left out.
	$(BIN)/python -m meshtide_lab.training.samples build/training/samples $(MESHES)
	cmake -S codec/core -B build/training -DCMAKE_BUILD_TYPE=Release && cmake --build build/training --target training
	set -e; cd build/training; for effort in default high classic; do \
		./training -t -r 5 -e $$effort -f $(CURDIR)/codec/meshtide_codec/states/$$effort.states; done

$(VENV)/zig.done: codec/core/build_backend.py
	$(PYTHON) -m venv $(VENV)/zig
	$(VENV)/zig/bin/python -m pip install --quiet $(ZIG)
	touch $@

wasm: $(VENV)/zig.done ## The decoder as WebAssembly, codec/core/wasm/*.wasm, and the core's tests in Node.
	cd codec/core && CXX="$(CURDIR)/$(VENV)/zig/bin/python -m ziglang c++" cmake --preset wasm && \
		cmake --build --preset wasm --parallel $(JOBS) && ctest --preset wasm
	cp build/wasm/meshtide.wasm build/wasm/meshtide-full.wasm codec/core/wasm/

web: $(VENV)/test.done ## The npm package of client/web: built, checked, its tests run by Node against a server of this repository.
	@command -v npm > /dev/null || { echo "make web needs Node and npm, which are not here: install nodejs and npm" >&2; exit 1; }
	cd client/web && npm ci --no-audit --no-fund && npm run build && npm run check && MESHTIDE=$(CURDIR)/$(BIN)/meshtide npm test

clean: ## Remove the virtual environment and all caches.
	rm -rf $(VENV) build codec/meshtide_codec/libmeshtide_core_* .pytest_cache .mypy_cache .ruff_cache .hypothesis demo-output client/web/dist client/web/node_modules
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
