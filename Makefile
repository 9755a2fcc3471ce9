# Every target installs what it needs into .venv by itself. PYTHON chooses the interpreter (3.11 or newer).
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALL := $(BIN)/python -m pip install --quiet --editable
QUICK := $(addprefix tests/,house model expression findings problem solvers/test_toys.py solvers/test_nothing_lost.py dynamics)

.PHONY: viewer help demo demo-walk test test-quick test-rest test-all test-loaded test-pipelines thorough lint typecheck docs docs-links reference bench bench-list bench-compare gallery release clean

help:  ## list the targets
	@sed -n 's/^\([a-z -]*\):.*## /make \1\t/p' Makefile

demo: $(VENV)/.installed  ## solve the ball throw with four solvers and write the report
	$(BIN)/symphys solve problems/ball_throw.toml --solver gradient,least_squares,ipopt,cma --out reports

demo-walk: $(VENV)/.installed  ## a quadruped learns to walk, in some two minutes; Ctrl-C stops it, and the same command goes on
	$(BIN)/symphys solve quadruped_walk --unexamined --out reports/walk

test: $(VENV)/.testing  ## run the tests; ARGS=tests/runs passes options to pytest
	$(BIN)/pytest -n auto --dist loadfile $(ARGS)

test-quick: $(VENV)/.testing  ## run the tests that tell most in a minute: the house, problem files, the step, solvers
	$(BIN)/pytest -n auto --dist loadfile $(QUICK) $(ARGS)

test-rest: $(VENV)/.developing  ## run what test leaves out: whole solves, pages of the documents, laws once more
	$(BIN)/pytest -n auto --dist worksteal -m "slow and not thorough" --ignore=tests/pipelines $(ARGS)

test-all: $(VENV)/.developing test test-rest  ## run all tests but those of thorough and test-pipelines

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

viewer:  ## bundle the 3D viewer of pages again, after a change in symphys/report/viewer; needs node and npm
	cd symphys/report/viewer && npm ci --silent && npx esbuild stage.js --bundle --minify --format=iife --legal-comments=none \
	    --banner:js="/* three $$(node -p "require('./node_modules/three/package.json').version"), MIT, and stage.js $$(cat stage.js package-lock.json | sha256sum | cut -c1-16) */" \
	    --outfile=../static/viewer.js
	cp symphys/report/viewer/node_modules/three/LICENSE symphys/report/static/three.LICENSE

bench bench-list: $(BIN)/python  ## list the benchmarks with their questions: make bench-NAME runs one
	@$(BIN)/python benchmarks/bench.py

bench-compare: $(VENV)/.developing  ## what got slower since OLD=COMMIT: both versions in turns, half an hour
	$(BIN)/python benchmarks/bench.py compare $(addprefix --old ,$(OLD)) $(ARGS)

bench-environments: $(VENV)/.pipelining

bench-imports: $(VENV)/.modelling

bench-gpu: $(VENV)/.computing

bench-tosses: OPTIONS = $(addprefix --data ,$(DATA))

bench-%: $(VENV)/.benching  # ARGS=--quick takes seconds; other options: ARGS=--help
	$(BIN)/python benchmarks/bench.py $* $(OPTIONS) $(ARGS)

gallery: $(VENV)/.installed  ## make the figures of the README again
	$(BIN)/symphys solve ball_throw bank_shot sled basket knock putt cart_pole --solver gradient,least_squares,ipopt,cma --out build/gallery
	$(BIN)/symphys report build/gallery --figures
	cp build/gallery/figures/ball_throw-motion.svg build/gallery/figures/ball_throw-convergence.svg \
	    build/gallery/figures/bank_shot-motion.svg build/gallery/figures/basket-motion.svg \
	    build/gallery/figures/knock-motion.svg build/gallery/figures/putt-motion.svg \
	    build/gallery/figures/cart_pole-strip.svg reports/gallery/
	cp build/gallery/sled/least_squares-seed0/figures/convergence.svg reports/gallery/sled-stages.svg
	$(BIN)/symphys solve quadruped_walk --unexamined --out build/walk
	$(BIN)/symphys report build/walk --figures
	cp build/walk/figures/quadruped_walk-strip.svg reports/gallery/
	$(BIN)/symphys report build/gallery/ball_throw/gradient-seed0 --video reports/gallery/ball_throw.webp --film
	$(BIN)/symphys report build/walk/quadruped_walk/stochastic-seed0 --video reports/gallery/quadruped_walk.webp --film

release: $(VENV)/.developing  ## build wheel and sdist into dist/, and try both in fresh environments; publishes nothing
	$(BIN)/python .ci/release.py $(ARGS)

clean:  ## remove what the other targets made, reports aside
	rm -rf $(VENV) build dist *.egg-info

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: setup.cfg pyproject.toml | $(BIN)/python
	$(INSTALL) . && touch $@

$(VENV)/.benching: $(VENV)/.installed
	$(INSTALL) '.[bench]' && mkdir -p build && touch $@

$(VENV)/.modelling: $(VENV)/.benching
	$(INSTALL) '.[models]' && touch $@

$(VENV)/.computing: $(VENV)/.benching
	$(INSTALL) '.[cuda]' && touch $@

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
