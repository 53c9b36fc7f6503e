# Two commands: `make reproduce` and `make test`. Each sets up .venv with what it needs, once.
PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check
# What stands in .venv: what the package needs, or the tools of its developers as well.
PACKAGE := .venv/.installed
TOOLS := .venv/.installed-dev
export XLA_FLAGS ?= --xla_cpu_multi_thread_eigen=false

.NOTPARALLEL:
.PHONY: reproduce test test-all setup check lint docs bench lock clean

reproduce: $(PACKAGE)
	$(BIN)/detpg reproduce

test: setup
	$(BIN)/python -m pytest -n 2 --dist loadfile

# Also what takes long: learning, killing, injected faults, whole examples. CI runs this.
test-all: setup
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "slow or not slow"

setup: $(TOOLS)

# A lock file holds every package with its hash; the package itself is linked, not copied. One that
# has changed since is installed from nothing; the tools are added to what the package needs.
define install
@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
  { echo "detpg needs Python 3.11 or later: make PYTHON=python3.12 setup"; exit 1; }
@if [ -e $@ ] || ! $(BIN)/python -m pip --version >/dev/null 2>&1; then \
  $(PYTHON) -m venv --clear .venv; fi
$(PIP) install --no-compile --require-hashes -r $<
$(PIP) install --no-deps --no-build-isolation --editable .
endef

$(PACKAGE): requirements.lock pyproject.toml
	$(install)
	@touch $(PACKAGE)

$(TOOLS): requirements-dev.lock pyproject.toml
	$(install)
	@touch $(PACKAGE) $(TOOLS)

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

# The package's packages are those of the developers, at the same versions.
COMPILE := uv pip compile pyproject.toml --universal --generate-hashes --no-emit-index-url \
  --no-annotate --no-header --python-version 3.11
lock:
	$(COMPILE) --group dev --extra minari --extra onnx -o requirements-dev.lock
	$(COMPILE) --group build --constraint requirements-dev.lock -o requirements.lock

clean:
	rm -rf .venv build
