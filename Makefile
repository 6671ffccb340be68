# make run [MODEL=path]   open the window, or draw a PNG where there is no display
# make test               everything that has to hold: lint and tests
# make lint               ruff, mypy and import-linter
# make stress             all cases of the stress tests, and what they found in docs/numerics.md
# make bench [MODELS=...] measure run time against error, and redraw the tables and plots of docs/benchmarks.md
#
# Each does all the set-up by itself: a virtual environment with the package, and on a Debian-like machine, run as
# root, the system packages that are missing.

# The first Python that the package supports.
PYTHON ?= $(shell for python in python3 python3.13 python3.12 python3.11; do \
	$$python -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null && echo $$python && break; done)
VENV := .venv
STAMP := $(VENV)/.installed

# What is looked for, and the Debian package that brings it: shared libraries, and programs that the tests of the
# window run.
LIBRARIES := libEGL.so.1:libegl1 libGL.so.1:libgl1
PROGRAMS := Xvfb:xvfb xdotool:xdotool

# Tests that run at once. More than the cores of a small machine would only wait for each other's kernels.
JOBS ?= 2

# What is measured: the built-in model, and real ones where their folder is there. The first is seen from all views.
SCANS := $(wildcard ../shared/models/igea.ply ../shared/models/stanford-bunny.obj)
MODELS ?= $(SCANS) built-in

.PHONY: run test stress lint bench clean
.DELETE_ON_ERROR:

run: $(STAMP)
	@$(call install_missing,$(LIBRARIES),)
	@$(VENV)/bin/surfelscope $(if $(MODEL),"$(MODEL)")

test: lint
	@$(call install_missing,$(LIBRARIES),$(PROGRAMS))
	$(VENV)/bin/python -m pytest -n $(JOBS) --dist worksteal $(PYTEST_ARGS)

stress: $(STAMP)
	@$(call install_missing,$(LIBRARIES),$(PROGRAMS))
	$(VENV)/bin/python -m pytest tests/stress --stress --stress-report $(PYTEST_ARGS)

lint: $(STAMP)
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports

# Takes 15 minutes at most, and can be interrupted: it goes on where it stopped. BENCH_ARGS=--restart begins anew, which
# it asks for where the code has changed since.
bench: $(STAMP)
	@$(call install_missing,$(LIBRARIES),)
	$(VENV)/bin/surfelscope bench $(MODELS) --quick --output build/bench/run.json --report docs/benchmarks.md $(BENCH_ARGS)

# A changed list of packages makes a new environment, so that nothing is left over from the old one.
$(STAMP): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "Surfelscope needs Python 3.11, 3.12 or 3.13 (none was found; set PYTHON=...)"; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || $(call install,python3-venv)
	@echo "Setting up $(VENV) (once, a minute or two)"
	@$(PYTHON) -m venv --clear $(VENV)
	@$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,lint]'
	@touch $@

clean:
	rm -rf $(VENV) build *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# install(packages): install Debian packages as root; say in one line what is missing elsewhere.
define install
{ if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	echo "Installing $(1)"; \
	{ apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends $(1); } \
		>/dev/null || echo "Could not install: $(1)"; \
else \
	echo "Missing: please install $(1) (these are the names of the Debian packages)"; \
fi; }
endef

# install_missing(library:package..., program:package...): on Linux, look for each and install what is not there.
define install_missing
[ "$$(uname)" = Linux ] || exit 0; \
cached=$$(PATH="$$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null); \
missing=; \
for pair in $(1); do case "$$cached" in *"$${pair%%:*}"*) ;; *) missing="$$missing $${pair##*:}";; esac; done; \
for pair in $(2); do command -v "$${pair%%:*}" >/dev/null || missing="$$missing $${pair##*:}"; done; \
[ -z "$$missing" ] || $(call install,$${missing# })
endef
