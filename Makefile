# Each target sets up what it needs; the second run finds it done.
SHELL := /bin/sh
# `make demo MOTION=e3` plays another motion, OUT=folder puts the result elsewhere.
MOTION ?= c3
OUT ?= out/demo
export ROS_PYTHON_CHECK_FIELDS ?= 1
# The longest first, so that no worker is left with them in the end.
TESTS := tests $(wildcard src/*/test addons/*/test)
# What must keep pace with a camera and a robot runs before the others: a busy machine fails it.
REAL_TIME := src/slosh_bringup/test/test_cell_node.py tests/real_time
# Two workers more than there are cores: tests of live nodes wait for each other half of the time.
# `make test WORKERS=0` runs all in one process, as a debugger wants it.
WORKERS ?= $(shell expr $$(getconf _NPROCESSORS_ONLN) + 2)
# As many of them as there are cores: none computes in several threads.
export OPENBLAS_NUM_THREADS ?= 1
export OPENCV_FOR_THREADS_NUM ?= 1
# The tests' compiled code is kept: each worker and each run would compile 400 files anew.
export PYTHONDONTWRITEBYTECODE =
PYTEST := tools/run python -m pytest
BESIDE := -n $(WORKERS) --no-loadscope-reorder
# A test of live nodes can fail because the machine stood still: what has failed (exit code 1) is run
# once more, alone. The output of both runs is shown.
define pytest_twice
@$(PYTEST) $(1) -o cache_dir=.pytest_cache/$@ || { code=$$?; [ $$code = 1 ] || exit $$code; \
	echo "make $@: what has failed is run once more, alone"; \
	$(PYTEST) $(SELECT) $(2) -o cache_dir=.pytest_cache/$@ --last-failed --last-failed-no-failures=none; }
endef

.PHONY: help setup test-setup demo test test-all validation keeping-pace the-others lint bench docs tables study coverage wheels clean

help:
	@echo "make demo      set up, run the simulated cell with all nodes, record, report"
	@echo "make test      set up, run the tests"
	@echo "make test-all  the long suites too"
	@echo "make validation  the tests of studies, blind suites and long runs"
	@echo "make coverage  which lines the tests run, to docs/results/coverage.md"
	@echo "make lint      formatting, style, types, import rules"
	@echo "make bench     the measurements behind each claim of speed"
	@echo "make docs      the documentation, to docs/_build/html"
	@echo "make tables    write the tables in docs/ anew, measuring what they state"
	@echo "make study     the packaging study: 1,530 experiments, models, limits; to docs/results/packaging_study.md"
	@echo "make wheels    wheels of all packages, to out/wheels, for a CI without this checkout"
	@echo "make clean     remove everything that setup made"

setup:
	@python3 tools/bootstrap.py

# The optional libraries too, which only tests and measurements use.
test-setup:
	@python3 tools/bootstrap.py --tests

demo: setup
	@ROS_PYTHON_CHECK_FIELDS=0 tools/run slosh demo --motion $(MOTION) -o $(OUT)

test: SELECT = -m "not long"
test: test-setup
	@$(MAKE) --no-print-directory --jobs=1 --keep-going SELECT='$(SELECT)' keeping-pace the-others

test-all: test-setup
	@$(MAKE) --no-print-directory --jobs=1 --keep-going SELECT=--hypothesis-profile=search the-others keeping-pace validation

validation: test-setup
	@nice -n 5 $(PYTEST) $(BESIDE) $(SELECT) validation

keeping-pace:
	$(if $(REAL_TIME),$(call pytest_twice,$(SELECT) $(REAL_TIME),$(REAL_TIME)))

the-others:
	$(call pytest_twice,$(BESIDE) $(SELECT) $(TESTS) $(REAL_TIME:%=--ignore=%),$(TESTS) $(REAL_TIME:%=--ignore=%))

coverage: test-setup
	@tools/run python -m pip install --quiet --no-deps -r requirements/coverage.txt
	@tools/run python tools/coverage_table.py

lint: setup
	@tools/run ruff format --check .
	@tools/run ruff check .
	@tools/run ruff check --config tools/compiled_code.toml .
	@tools/run lint-imports --no-logo --no-cache
	@tools/run python tools/typecheck.py

bench: test-setup
	@missed=0; for file in benchmarks/bench_*.py; do ROS_PYTHON_CHECK_FIELDS=0 tools/run python $$file || missed=1; done; exit $$missed

tables: setup
	@tools/run python tools/stranger.py --docs
	@tools/run python tools/effect_pages.py
	@tools/run python tools/generated_text.py
	@tools/run python tools/accuracy_tables.py
	@tools/run python validation/studies/camera_accuracy.py --disturb --docs
	@tools/run python validation/studies/side_view_tables.py --docs

study: setup
	@tools/run python validation/studies/packaging_study.py --docs

docs: setup
	@tools/run sphinx-build -W --keep-going -q -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

wheels: setup
	@tools/run python tools/wheels.py -o out/wheels

clean:
	rm -rf .venv out docs/_build ros2_ws/build ros2_ws/install ros2_ws/log
