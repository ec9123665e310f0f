# make demo    set up, then play real friction readings through the live node, verify, report
# make test    set up, then lint, types and tests
# make test-long    the tests that take minutes, which `make test` leaves out
# make test-lowest  core and offline with the lowest versions of all packages
# make setup   only set up .venv
# make bench   figures of speed
# make figures the figures in docs/figures

.PHONY: demo test test-long test-lowest setup bench figures clean
.DEFAULT_GOAL := demo

python := .venv/bin/python
unexport PYTHONDONTWRITEBYTECODE  # tests start hundreds of processes, and each would compile every module anew
unexport CI BUILD_NUMBER  # with these, pytest shows the whole difference of two pages that differ, which takes hours
workers = $(shell echo $$(($$(nproc) + 1)))# one more: live tests wait
ifdef ROS_DISTRO
export LD_LIBRARY_PATH := $(CURDIR)/.venv/lib:$(LD_LIBRARY_PATH)
endif

setup:
	@tools/setup.sh run

demo: setup
	@$(python) tools/demo.py

test:
	@tools/setup.sh dev
	$(python) -m ruff check .
	$(python) -m ruff format --check .
	$(python) -m mypy
	$(python) -m pytest --numprocesses $(workers) --dist loadfile --no-loadscope-reorder

test-long:
	@tools/setup.sh dev
	$(python) -m pytest -m long

test-lowest: setup
	@tools/test_lowest.sh

bench: setup
	@$(python) bench/step.py
	@$(python) bench/loop.py
	@$(python) bench/servo.py
	@$(python) bench/oring.py --lines 17 25 33
	@$(python) bench/ehl.py
	@$(python) bench/offline.py

figures: setup
	@$(python) tools/make_figures.py

clean:
	rm -rf .venv build
