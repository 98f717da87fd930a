# Two commands do everything on a fresh machine with Python, git and make: `make demo` and `make test`.
PYTHON ?= python3
# Packages and the browser are fetched side by side; of several goals one comes after the other.
ifeq ($(words $(MAKECMDGOALS)),1)
MAKEFLAGS += --jobs=2
endif
# Packages are installed uncompiled: where this forbids keeping what an import has compiled, each of the hundred processes of a
# test run, and each of the demo, would compile them again, for 5 s.
unexport PYTHONDONTWRITEBYTECODE
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: help install browser kernels demo test chaos lint audit-deps bench evaluate testbench prove fuzz coverage load pictures lock clean

help:
	@echo "make demo     set up, start the service on the embedded default, audit a demo plant, show the table"
	@echo "make test     set up, run all tests"
	@echo "make install  set up .venv with the command line in it"
	@echo "make bench    benchmarks, side by side with their peers"
	@echo "make evaluate the verdict on labelled recordings, leaving one valve out (RECORDINGS=folder with labels.csv)"
	@echo "make testbench whole audits of simulated loops, one factor at a time (minutes; JOBS=processes)"
	@echo "make chaos    half an hour of faults on a service of its own, and what is left of its promises (SEED=number replays)"
	@echo "make prove    run explain blind over loops with concealed physics (COUNT, SEED, JOBS, FORMS=own, KINDS=clean|one|two|outside, RUNNING=1, UNKNOWN=0.5, SAMPLES=50000)"
	@echo "make fuzz     hostile requests to the API, files led by coverage to the readers (COUNT=requests, SECONDS=, SEED=)"
	@echo "make coverage every branch of claim and finish and of the readers, or it fails"
	@echo "make load     many clients at once against a real API process"
	@echo "make pictures the README's pictures, of the demo plant in Chromium"
	@echo "make lint     style, import rules and types"
	@echo "make audit-deps  known holes in the pinned dependencies (needs a network)"
	@echo "make lock     pin the dependencies anew"

# Without compiling all of the packages, which took 30 of 71 s: what is imported is compiled at its first use.
$(STAMP): requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "loopaudit needs Python 3.11 or newer, this is " + sys.version.split()[0])'
	$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv $(VENV) \
		|| { echo "no virtual environment with pip can be made: on Debian and Ubuntu, apt-get install python3-venv" >&2; exit 1; }
	@echo "installing the pinned packages into $(VENV): one to five minutes, once"
	$(BIN)/python -m pip install --quiet --no-compile --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	$(BIN)/python -c 'import app.main, workers.tasks'
	touch $(STAMP)

install: $(STAMP)

# The browser tests drive Debian's Chromium; where this cannot install it, they are skipped and say so.
browser:
	@command -v chromium >/dev/null || command -v google-chrome >/dev/null \
		|| { test "$$(id -u)" = 0 && command -v apt-get >/dev/null \
			&& apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core; } \
		|| echo "no Chromium here, and no right to install one: the browser tests will be skipped"

demo: install
	$(BIN)/loopaudit demo

# Once and by both cores, before several test processes would wait for the one of them that compiles.
kernels: install
	$(BIN)/python -c "from workers.process import load_or_compile; load_or_compile()"

# Four at a time on two cores: while servers start and workers wait for messages, somebody computes. One thread each: a second
# one of the linear algebra would wait for small matrices, at the cost of the others.
test: install browser kernels
	$(BIN)/ruff check .
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 4 --dist loadfile --no-loadscope-reorder --durations 25

lint: install
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/mypy app workers migrations

# Each section beside its peers (SECTIONS="search audit" for some); the page keeps the figures of the others.
POSTGRES ?= postgresql+psycopg://127.0.0.1/postgres
REDIS ?= redis://127.0.0.1:6379/9
bench: install
	$(BIN)/python -m pip install --quiet --require-hashes -r requirements-bench.lock || echo "without SIPPY: it cannot be installed here"
	$(BIN)/loopaudit bench $(SECTIONS) --out docs/performance.json --page docs/PERFORMANCE.md --recordings $(RECORDINGS) \
		--postgres $(POSTGRES) --redis $(REDIS)

# Looks the pinned dependencies up in public lists of known holes, so it needs a network and says so where there is none.
audit-deps: install
	$(BIN)/pip-audit --strict --require-hashes --disable-pip --requirement requirements.lock

RECORDINGS ?= ../shared/recordings

# WRITE=--write puts the fitted parameters into the engine; MORE=--stored judges the recordings as other historians would have stored
# them, MORE=--groups leaves whole sources and industries out.
evaluate: install
	$(BIN)/python -m app.lab.evaluation $(RECORDINGS) --reference $(WRITE) $(MORE)

testbench: install
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m app.lab.testbench --jobs $(or $(JOBS),1) --write docs

# Blind cases with concealed physics: what explain names, what it accuses wrongly, how well it fits (COUNT=200 takes a quarter hour).
prove: install
	PYTHONPATH=. OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python tests/proof/prove.py --count $(or $(COUNT),200) --jobs $(or $(JOBS),1) \
		--seed $(or $(SEED),7) --forms $(or $(FORMS),foreign) --kinds $(or $(KINDS),all) $(if $(RUNNING),--running) $(if $(UNKNOWN),--unknown $(UNKNOWN)) $(if $(SAMPLES),--samples $(SAMPLES)) $(if $(LEAST),--least-energy $(LEAST)) $(if $(OUT),--out $(OUT))

# Finds are written to .fuzz/found; the corpus of the readers stays in .fuzz/readers for the next search.
fuzz: install
	$(BIN)/python -m pip install --quiet --require-hashes -r requirements-fuzz.lock
	PYTHONPATH=. $(BIN)/python -W ignore tests/fuzz/api.py --requests $(or $(COUNT),100000) --seed $(or $(SEED),1) \
		--schemathesis-seconds $(or $(SECONDS),300)
	PYTHONPATH=. POLARS_MAX_THREADS=1 $(BIN)/python tests/fuzz/readers.py --seconds $(or $(SECONDS),300) --seed $(or $(SEED),1)

# By hand and in a pipeline, beside `make test`: measuring costs what the tests of these parts cost once more.
coverage: install
	$(BIN)/coverage run -m pytest -q -p no:cacheprovider tests/ingest tests/storage tests/services/test_uploads.py tests/services/test_same_upload.py tests/services/test_tag_files.py
	$(BIN)/coverage report --include='app/storage/leases.py,app/storage/items.py,app/storage/uploads.py,app/storage/explanations.py'
	$(BIN)/coverage report --include='app/ingest/*'

# 50 clients, ten uploads each, beside dashboards, audits and a slow client; a shorter cut is part of `make test`.
load: install
	LOAD_CLIENTS=50 LOAD_ROUNDS=10 $(BIN)/pytest -q -s --timeout 1800 tests/load

# Starts PostgreSQL, Redis, API, workers and schedule by itself, on ports of their own, and ends them all.
# PAGE=docs/RELIABILITY.md writes the table into the page; MORE='--faults 20' and the like: python -m tests.chaos --help
chaos: install
	$(BIN)/python -m tests.chaos $(if $(SEED),--seed $(SEED)) $(if $(PAGE),--page $(PAGE)) $(MORE)

pictures: install browser
	$(BIN)/python -m tests.web.pictures docs/images

# Hashes, markers for every supported Python, and no address of any registry.
lock:
	test -x .lock-venv/bin/uv || ($(PYTHON) -m venv .lock-venv && .lock-venv/bin/pip install --quiet uv)
	.lock-venv/bin/uv pip compile --quiet --universal --python-version 3.11 --all-extras --generate-hashes \
		--no-emit-index-url --no-emit-find-links --no-header --output-file requirements.lock pyproject.toml
	echo sippy-unipi | .lock-venv/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
		--constraint requirements.lock --no-emit-index-url --no-emit-find-links --no-header \
		--output-file requirements-bench.lock -
	printf 'atheris<3.1\nschemathesis\n' | .lock-venv/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
		--constraint requirements.lock --no-emit-index-url --no-emit-find-links --no-header \
		--output-file requirements-fuzz.lock -

clean:
	rm -rf $(VENV) .lock-venv .loopaudit .pytest_cache .ruff_cache .mypy_cache
