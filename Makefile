# Every target installs what it needs into .venv by itself. PYTHON chooses the interpreter (3.11 or newer).
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALL := $(BIN)/python -m pip install --quiet --editable
QUICK := $(addprefix tests/,house model expression findings problem solvers/test_toys.py solvers/test_nothing_lost.py dynamics)

.PHONY: help demo demo-walk test test-quick test-rest test-all test-loaded test-pipelines thorough lint typecheck docs docs-links reference bench bench-contact bench-robots bench-mpc bench-table1 bench-gpu bench-walk bench-lessons stress bench-pipelines bench-runs bench-gaits bench-imports bench-idto bench-tosses bench-compare profiles gallery clean

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /make \1\t/p' Makefile

demo: $(VENV)/.installed  ## solve the ball throw with four solvers and write the report
	$(BIN)/symphys solve problems/ball_throw.toml --solver gradient,least_squares,ipopt,cma --out reports

demo-walk: $(VENV)/.installed  ## a quadruped learns to walk, in some two minutes; Ctrl-C stops it, and the same command goes on
	$(BIN)/symphys solve quadruped_walk --unexamined --out reports/walk

test: $(VENV)/.testing  ## run the tests; ARGS=tests/runs passes options to pytest
	$(BIN)/pytest -n auto --dist loadfile $(ARGS)

test-quick: $(VENV)/.testing  ## run the tests that tell most in a minute: the house, problem files, the step, solvers
	$(BIN)/pytest -n auto --dist loadfile $(QUICK) $(ARGS)

test-rest: $(VENV)/.developing  ## run what test leaves out: whole solves, pages of the documents, laws once more
	$(BIN)/pytest -n auto --dist worksteal -m "slow and not thorough" $(ARGS)

test-all: $(VENV)/.developing test test-rest  ## run all tests but those of thorough

test-loaded: $(VENV)/.testing  ## run the tests beside four busy loops, which end with them, and with a random PYTHONHASHSEED
	@for loop in 1 2 3 4; do (while kill -0 $$$$; do :; done) > /dev/null 2>&1 & done; \
	export PYTHONHASHSEED=$$($(BIN)/python -c 'import random; print(random.randrange(2**32))'); \
	echo "PYTHONHASHSEED=$$PYTHONHASHSEED"; $(BIN)/pytest -n auto --dist loadfile $(ARGS)

test-pipelines: $(VENV)/.pipelining  ## run the tests of symphys.torch, symphys.jax and symphys.env, and install what they need
	$(BIN)/pytest tests/pipelines tests/house/test_code_blocks.py -k pipelines -m "not thorough" $(ARGS)

thorough: $(VENV)/.developing  ## run the tests that take minutes: ten thousand random scenes, tall towers, long rolls
	$(BIN)/pytest -n auto -m thorough $(ARGS)

lint: $(VENV)/.developing  ## check style and format
	$(BIN)/ruff check . && $(BIN)/ruff format --check .

typecheck: $(VENV)/.developing  ## check types on a folder of links laid out as the package is installed
	rm -rf build/farm && mkdir -p build/farm/symphys
	cd build/farm/symphys && ln -s ../../../symphys/* ../../../solvers ../../../problems .
	$(BIN)/mypy -p symphys

docs: $(VENV)/.documenting  ## build the site into build/docs; a warning, a broken link or a failing notebook ends it
	$(BIN)/python -m sphinx -E -n -W --keep-going -b html docs build/docs

docs-links: $(VENV)/.documenting  ## ask every external link of the site; needs a network
	$(BIN)/python -m sphinx -D nb_execution_mode=off -b linkcheck docs build/docs-links

reference: $(VENV)/.installed  ## write docs/problem_reference.md again, after a change of the schema or of solver options
	$(BIN)/symphys schema --markdown --out docs/problem_reference.md

bench: $(VENV)/.benching  ## solvers, smoothing, kernels, MuJoCo with loose bodies, of docs/results; figures go to build/
	$(BIN)/python benchmarks/ball_throw.py
	$(BIN)/python benchmarks/continuation.py
	$(BIN)/python benchmarks/spheres.py
	$(BIN)/python benchmarks/limit.py build
	$(BIN)/python benchmarks/pile.py build
	$(BIN)/python benchmarks/against_mujoco.py
	$(BIN)/python benchmarks/front_door.py

bench-contact: $(VENV)/.benching  ## errors of contact against the step, gradients, what each device buys; an hour
	$(BIN)/python benchmarks/gradients.py build
	$(BIN)/python benchmarks/ablation.py
	$(BIN)/python benchmarks/consistency.py build
	$(BIN)/python benchmarks/coupled_study.py

bench-robots: $(VENV)/.benching  ## jointed robots: what each device of joints buys; agreement, errors, speed against MuJoCo and casadi's C; growth of adjoints
	$(BIN)/python benchmarks/joint_study.py build
	$(BIN)/python benchmarks/robot_agreement.py
	$(BIN)/python benchmarks/robot_consistency.py build
	$(BIN)/python benchmarks/robot_against_mujoco.py
	$(BIN)/python benchmarks/robot_growth.py
	$(BIN)/python benchmarks/robot_kernels.py
	$(BIN)/python benchmarks/step_jacobians.py
	$(BIN)/python benchmarks/stage_costs.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/ilqr_iteration.py

bench-mpc: $(VENV)/.installed  ## model predictive control of plants that differ from their models: rates, latencies, tasks done
	$(BIN)/python benchmarks/mpc.py
	$(BIN)/python benchmarks/mpc.py --faster 2

bench-walk: $(VENV)/.benching  ## robots that learn to walk, three seeds each; their gaits in unseen samples of scenarios (half an hour)
	$(BIN)/python benchmarks/trot.py
	$(BIN)/python benchmarks/walking.py
	$(BIN)/python benchmarks/walking.py quadruped_walk_net
	$(BIN)/python benchmarks/walking.py gait_robot_fast
	$(BIN)/python benchmarks/building.py
	$(BIN)/python benchmarks/walk_gradient.py

bench-lessons: $(VENV)/.benching  ## solvers on one walk against time, what domain randomization buys, what each option does (an hour)
	$(BIN)/python benchmarks/race.py quadruped_walk build
	$(BIN)/python benchmarks/race.py quadruped_walk_net build
	$(BIN)/python benchmarks/robustness.py build
	$(BIN)/python benchmarks/lessons.py

stress: $(VENV)/.developing  ## kill a batch a hundred times, do 10,000 runs, make 2,000 pages (twenty minutes)
	$(BIN)/python benchmarks/killing.py --runs 400 --kills 100 --drivers 3
	$(BIN)/python benchmarks/overhead.py --runs 10000
	SYMPHYS_FSYNC=1 $(BIN)/python benchmarks/overhead.py --runs 2000
	$(BIN)/python benchmarks/report_pages.py 2000 2
	$(BIN)/python benchmarks/report_pages.py 10000 2

bench-pipelines: $(VENV)/.pipelining  ## steps for environments and nets against their kernel
	$(BIN)/python benchmarks/step_rates.py

bench-runs: $(VENV)/.developing  ## the table of ten thousand runs
	$(BIN)/python benchmarks/table_of_runs.py

bench-gaits: $(VENV)/.benching  ## gaits of Gymnasium's models, rated as Gymnasium does, here and in MuJoCo
	$(INSTALL) '.[models]'
	$(BIN)/python benchmarks/imported_gaits.py build/gaits
	$(BIN)/python benchmarks/shac_ant.py

bench-imports: $(VENV)/.benching  ## 56 robots of gymnasium, dm_control and example-robot-data after import, against MuJoCo (two hours)
	$(INSTALL) '.[models]'
	$(BIN)/python benchmarks/imported_robots.py build/imported
	$(BIN)/python benchmarks/imported_statics.py

profiles: $(VENV)/.installed  ## every method on the shipped problems from 15 starts: which one to take when (an hour); the same command goes on
	$(BIN)/python benchmarks/profiles.py build/profiles

bench-table1: $(VENV)/.benching  ## the timing table of Degrave et al. (1 and 128 robots, small and large net), cost against weights
	$(BIN)/python benchmarks/table1.py
	$(BIN)/python benchmarks/weights.py build

bench-gpu: $(VENV)/.benching  ## the same on a GPU, with the floors; without one: floors, registers and spills; errors of single precision
	$(BIN)/python -m pip install --quiet --editable '.[cuda]'
	$(BIN)/python benchmarks/rounding.py
	$(BIN)/python benchmarks/gpu.py

bench-idto: $(VENV)/.installed  ## tasks of IDTO by iLQR: iterations, seconds, the answers at half the time step
	$(BIN)/python benchmarks/idto_tasks.py

bench-tosses: $(VENV)/.benching  ## recorded tosses of a cube and an elbow against MuJoCo, from DATA=FOLDER; two hours of a processor
	$(BIN)/python benchmarks/identify_speed.py $(DATA)
	$(BIN)/python benchmarks/tosses.py $(DATA)
	$(BIN)/python benchmarks/tosses.py $(DATA) --study flights,ablations,splits,limits --evaluations 200

bench-compare: $(VENV)/.developing  ## this version against another, in turns: speed, start, memory, numbers; OLD=COMMIT, half an hour
	$(BIN)/python benchmarks/versions.py $(OLD)

gallery: $(VENV)/.installed  ## make the figures of the README again
	$(BIN)/symphys solve ball_throw bank_shot sled basket knock putt cart_pole --solver gradient,least_squares,ipopt,cma --out build/gallery
	cp build/gallery/figures/ball_throw-motion.svg build/gallery/figures/ball_throw-convergence.svg \
	    build/gallery/figures/bank_shot-motion.svg build/gallery/figures/basket-motion.svg \
	    build/gallery/figures/knock-motion.svg build/gallery/figures/putt-motion.svg \
	    build/gallery/figures/cart_pole-strip.svg reports/gallery/
	cp build/gallery/sled/least_squares-seed0/figures/convergence.svg reports/gallery/sled-stages.svg
	$(BIN)/symphys solve quadruped_walk --unexamined --out build/walk
	cp build/walk/figures/quadruped_walk-strip.svg reports/gallery/

clean:  ## remove what the other targets made, reports aside
	rm -rf $(VENV) build dist *.egg-info

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: setup.cfg pyproject.toml | $(BIN)/python
	$(INSTALL) . && touch $@

$(VENV)/.benching: $(VENV)/.installed
	$(INSTALL) '.[bench]' && mkdir -p build && touch $@

$(VENV)/.testing: setup.cfg pyproject.toml | $(BIN)/python
	$(INSTALL) '.[test]' --no-compile && touch $(VENV)/.installed $@

$(VENV)/.developing: setup.cfg pyproject.toml | $(BIN)/python
	$(INSTALL) '.[dev]' --no-compile && touch $(VENV)/.installed $(VENV)/.testing $@

$(VENV)/.documenting: $(VENV)/.installed
	$(INSTALL) '.[docs]' && touch $@

$(VENV)/.pipelining: $(VENV)/.developing  # PyTorch for processors is a tenth of what comes with a GPU's libraries
	$(BIN)/python -m pip install --quiet --retries 1 torch --index-url https://download.pytorch.org/whl/cpu \
	    || echo "PyTorch could not be fetched from download.pytorch.org: its tests are skipped"
	$(INSTALL) '.[env,jax]' && touch $@
