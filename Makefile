# Two commands: `make reproduce` and `make test`. Both set up .venv first, once.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed
export XLA_FLAGS ?= --xla_cpu_multi_thread_eigen=false

.NOTPARALLEL:
.PHONY: reproduce test test-all setup check lint docs bench lock clean

reproduce: setup
	$(BIN)/detpg reproduce

test: setup
	$(BIN)/python -m pytest -n 2 --dist loadfile

# Also what takes long: learning, killing, injected faults, whole examples. CI runs this.
test-all: setup
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "slow or not slow"

setup: $(STAMP)

# The lock file holds every package with its hash; the package itself is linked, not copied.
$(STAMP): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "detpg needs Python 3.11 or later: make PYTHON=python3.12 setup"; exit 1; }
	$(PYTHON) -m venv --clear .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $(STAMP)

check: lint docs test

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports
	$(BIN)/codespell
	$(BIN)/python docs/generate.py --check

docs: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict --site-dir build/site

# make bench ONLY=figure1.sweep
bench: setup
	$(BIN)/python -m benchmarks $(ONLY)

lock:
	uv pip compile pyproject.toml --group dev --extra minari --extra onnx --universal --generate-hashes \
	  --no-emit-index-url --no-annotate --no-header --python-version 3.11 -o requirements.lock

clean:
	rm -rf .venv build
