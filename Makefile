# make demo   fly 25 drones in 25 processes and print the report
# make test   run all tests          make lint   ruff, mypy and who may import whom
# make bench  measure this machine   make clean  remove the virtual environment and caches
# make wheel  a wheel that flies without compiling, in dist/
# make fuzz   fuzz all that reads bytes from outside, a minute each; TARGET=frame RUNS=10000000: one of them, so many inputs

PYTHON ?= python3
BIN := .venv/bin

# Of the many processes of a flight, and of a test run, each would compile all sources anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test rules lint bench wheel fuzz clean

demo: .venv/ready
	$(BIN)/rsc-swarm launch --agents 25

# Four files at a time, since many tests wait, and the long ones not last; the rules are compiled once, before. What hangs
# inside a library takes its worker along; its file is tried once more, and then the run ends and names it.
test: .venv/ready-test
	+@$(MAKE) --no-print-directory --jobs 2 --output-sync=target lint rules
	$(BIN)/python -m pytest --numprocesses 4 --dist loadfile --no-loadscope-reorder --max-worker-restart 1

rules: .venv/ready
	$(BIN)/rsc-swarm warm-up

lint: .venv/ready-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: .venv/ready
	$(BIN)/rsc-swarm bench

# With the rules in it as they are compiled here.
wheel: .venv/ready
	rm -rf build
	$(BIN)/rsc-swarm warm-up --shared
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .
	rm -rf build protocols/compiled

fuzz: .venv/ready-fuzz
	RSC_SWARM_PYTHON_KERNELS=1 $(BIN)/python -m tests.fuzz $(TARGET) $(if $(RUNS),--runs $(RUNS) --seconds 0)

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "rsc-swarm needs Python 3.11 or later; name one with: make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -m venv .venv || { rm -rf .venv; echo "no virtual environments here; on Debian: sudo apt install python3-venv"; exit 1; }

.venv/ready: pyproject.toml constraints.txt | .venv/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[plot]'
	@touch $@

.venv/ready-test: .venv/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[plot,radio,mavlink,mcap,test,train,view]'
	@touch $@

.venv/ready-fuzz: .venv/ready-test
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[plot,radio,mavlink,mcap,test,train,view,fuzz]'
	@touch $@

clean:
	rm -rf .venv build dist protocols/compiled *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
