# make demo   simulate the three-radar scene, associate it with the ant colony, print the result
# make test   install what the tests need and run them, of the slow ones a sample (CONTRIBUTING.md)
# make test-all         all tests, and the share of the lines that they run: what a release needs
# make lint   ruff (rules and format), mypy and import-linter
# make docs   the pages of docs/, tutorials executed, into docs/_build/html
# make check-set        the benchmark set (experiments/sdlib): made anew, compared, every solution and proof checked
# make rows   each command that a row of docs/papers.md names, small; FOLDER=tables of the thesis for those that need it
# make mutants          faults put in on purpose: each must make the tests of its room fail
# make fuzz   20,000 spoiled files for every reader and program, then 3,000 problems for every solver
# make test-oldest      the tests with the oldest version of each dependency that pyproject.toml allows
# make test-newest      a part of the tests with a newer Python (3.13 or 3.12) where there is one; TESTS=tests for all
# make test-uncompiled  a part of the tests with numba switched off
# make test-checked     a sixteenth of the tests, another each time: kernels check indices, what is freed is overwritten
# make dist             sdist, wheel, and a wheel with compiled kernels for this Python and system, into dist/
# make check-dist       the same, and checks what they hold, that they work in an empty environment, and compile nothing;
#                       of another Python: make check-dist VENV=.venv-3.12 PYTHON=python3.12
# make audit            what is known of holes in the dependencies (asks an index of advisories)
# make bench  benchmarks at full size, some hours (python -m experiments.benchmarks --brief: everything in 25 minutes)
# make bench-quick      a minute: has something become twice as slow, beside HiGHS in the same process?

PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3.14 python3 python; do \
	if $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then command -v $$p; break; fi; done)
VENV := .venv
OLDEST := .venv-oldest
# newer ones that the tests are run with, on the path or installed by pyenv
NEWEST := .venv-newest
NEWER ?= $(shell for p in python3.13 python3.12 $(HOME)/.pyenv/versions/3.13*/bin/python $(HOME)/.pyenv/versions/3.12*/bin/python; do \
	if "$$p" -c '' >/dev/null 2>&1; then command -v "$$p"; break; fi; done)
TESTS ?= tests/sensors tests/test_problem.py tests/packing/test_matching.py tests/solvers/test_reduction.py tests/proofs \
	"tests/solvers/test_against_brute_force.py::test_small_problems[1.0-exact]"
# tests with much behind them that are quick without a compiler
UNCOMPILED := tests/sensors tests/test_problem.py tests/costs/test_tracks.py tests/simulation/test_observation.py \
	tests/solvers/test_reduction.py tests/packing/test_matching.py tests/packing/test_dimensionwise.py \
	"tests/solvers/test_against_brute_force.py::test_small_problems[1.0-exact]" tests/tracking/test_multi_sensor.py
# files of tests that call kernels, of which every sixteenth is run with checked indices: others on another day and
# after another commit, or CHECKED="tests/FILE ..."
KERNELS := packing solvers ranking costs filters tracking registration sensors association
CHECKED ?= $(shell ls $(KERNELS:%=tests/%/test_*.py) | awk -v turn=$$(( $$(git rev-list --count HEAD 2>/dev/null || echo 0) + \
	$$(date +%-j) )) 'NR % 16 == turn % 16')
PY := $(VENV)/bin/python
PIP := $(PY) -m pip install --quiet --disable-pip-version-check

SPHINX = $(PY) -m sphinx -W --keep-going -q -b html docs docs/_build/html

.PHONY: demo test test-all test-oldest test-newest test-uncompiled test-checked lint docs fuzz check-set rows mutants dist check-dist audit bench bench-quick clean

demo: $(VENV)/.installed
	@mkdir -p demo
	$(PY) -m assoc.simulate three-radar -o demo/scene.npz
	$(PY) -m assoc.solve demo/scene.npz --solver aco --json demo/result.json

test: $(VENV)/.installed-test
	$(PY) -m tests.compile_first
	$(PY) -m pytest -n 2 --dist worksteal -q -m "not slow"

test-all: $(VENV)/.installed-test
	$(PY) -m tests.compile_first
	$(PY) -m pytest -n 2 --dist worksteal -q --cov --cov-report=

lint: $(VENV)/.installed-lint
	$(PY) -m ruff check .
	$(PY) -m ruff format --check --quiet .
	$(PY) -m mypy
	$(VENV)/bin/lint-imports

# the first time tutorials say that kernels are compiled, which -W takes for a warning
docs: $(VENV)/.installed-docs
	$(SPHINX) || $(SPHINX)

fuzz: $(VENV)/.installed-test
	$(PY) -m tests.reliability.fuzzing --count 20000 --processes 2
	$(PY) -m tests.reliability.differential --count 3000 --processes 2

check-set: $(VENV)/.installed-test
	$(PY) -m experiments.sdlib make --compare
	$(PY) -m experiments.sdlib check

rows: $(VENV)/.installed-test
	$(PY) -m experiments.pages.commands $(if $(FOLDER),--folder "$(FOLDER)")

mutants: $(VENV)/.installed-test
	$(PY) -m tests.mutations

# numba keeps the kernels of one version only: they must not take the place of the others
test-oldest: $(OLDEST)/.installed-test
	NUMBA_CACHE_DIR="$(CURDIR)/$(OLDEST)/kernels" $(OLDEST)/bin/python -m pytest -n 2 -q -p no:cacheprovider

test-newest:
	@if [ -n "$(NEWER)" ]; then $(MAKE) $(NEWEST)/.installed-test && $(NEWEST)/bin/python -m pytest -n 2 -q -p no:cacheprovider \
		-m "not slow" $(TESTS); else echo "no Python 3.13 or 3.12 here: nothing tested" >&2; fi

test-uncompiled: $(VENV)/.installed-test
	NUMBA_DISABLE_JIT=1 $(PY) -m pytest -n 2 -q -p no:cacheprovider $(UNCOMPILED)

# the kernels are others, and keep a folder of their own
test-checked: $(VENV)/.installed-test
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR="$(CURDIR)/$(VENV)/checked-kernels" PYTHONMALLOC=debug MALLOC_PERTURB_=165 \
		$(PY) -m pytest -n 2 -q -p no:cacheprovider -m "not slow" $(CHECKED)

dist: $(VENV)/.installed-release
	$(PY) -m tests.release.build dist

check-dist: $(VENV)/.installed-release
	$(PY) -m tests.release.distribution dist

audit: $(VENV)/.installed-release
	$(PY) -m pip freeze --exclude-editable > $(VENV)/frozen.txt
	$(PY) -m pip_audit --strict --disable-pip --no-deps -r $(VENV)/frozen.txt
	$(VENV)/bin/pip-licenses --partial-match --fail-on "GNU General Public;GNU Affero;GPLv"

bench: $(VENV)/.installed-peers
	$(PY) -m experiments.benchmarks

bench-quick: $(VENV)/.installed-test
	$(PY) -m experiments.bench_quick

clean:
	rm -rf $(VENV) $(OLDEST) $(NEWEST) demo dist docs/_build

# the stamps make a changed pyproject.toml (a new dependency, say) reach an environment that exists already
$(VENV)/.created:
	@test -n "$(PYTHON)" || { echo "assoc needs Python 3.11 or newer: make PYTHON=/path/to/python" >&2; exit 1; }
	"$(PYTHON)" -m venv $(VENV)
	@touch $@

$(VENV)/.installed: $(VENV)/.created pyproject.toml
	$(PIP) -e .
	@touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	$(PIP) -e ".[test]"
	@touch $@

$(VENV)/.installed-peers: $(VENV)/.installed
	$(PIP) -e ".[test,peers]"
	@touch $@

$(VENV)/.installed-lint: $(VENV)/.installed
	$(PIP) -e ".[test,lint]"
	@touch $@

$(VENV)/.installed-docs: $(VENV)/.installed
	$(PIP) -e ".[docs]"
	@touch $@

$(VENV)/.installed-release: $(VENV)/.installed
	$(PIP) -e ".[release]"
	@touch $@

$(NEWEST)/.installed-test: pyproject.toml
	"$(NEWER)" -m venv --clear $(NEWEST)
	$(NEWEST)/bin/python -m pip install --quiet --disable-pip-version-check -e ".[test]"
	@touch $@

$(OLDEST)/.installed-test: $(VENV)/.installed-test tests/release/oldest.py
	"$(PYTHON)" -m venv --clear $(OLDEST)
	$(PY) -m tests.release.oldest > $(OLDEST)/constraints.txt
	$(OLDEST)/bin/python -m pip install --quiet --disable-pip-version-check -e ".[test]" -c $(OLDEST)/constraints.txt
	@touch $@
