# Two commands: `make run` solves the reference spindle, `make test` runs the tests.
# Both set everything up first. PYTHON names the interpreter (3.11 or later).
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
RESULT ?= runs/wu_tan_2016

# More BLAS threads than one only fight with the solver's own.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: run test kernels setup lint lowest docs wheel-check first-hour browser reference study book proof hardening clean

run: $(READY)
	$(BIN)/spindle-fem run -o $(RESULT)

# The report in the repository: that of the reference run, without fields and data.
reference: run
	mkdir -p reports/reference_run/figures
	cp $(RESULT)/report.html $(RESULT)/summary.json $(RESULT)/machine.toml reports/reference_run/
	cp $(addprefix $(RESULT)/figures/,machine_definition.png temperature_cut.png channel_walls.png \
	    bearings_front.png heat_balance.png over_speed_heat_terms.png deformed_machine.png) reports/reference_run/figures/

test: $(READY) lint
	$(MAKE) --no-print-directory -j2 wheel-check kernels
	$(BIN)/python -m pytest -q

# What a first diagnosis, and each worker of the tests, would wait for is compiled and kept beside its module.
kernels: $(READY)
	$(BIN)/python examples/diagnose.py build/kernels >/dev/null

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

setup: $(READY)

$(READY): pyproject.toml constraints.txt scripts/setup.sh
	PYTHON="$(PYTHON)" VENV="$(VENV)" bash scripts/setup.sh
	touch $@

# A small run from an installed wheel, away from the source tree.
wheel-check: $(READY)
	bash scripts/wheel_check.sh $(BIN)/python

# README's first hour from the wheel and its dependencies alone, in an empty environment.
first-hour: $(READY)
	bash scripts/first_hour.sh $(BIN)/python

# The interactive page in the Chromium of this machine, a picture of every view in build/views.
browser: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[browser]'
	VIEW_PICTURES=build/views $(BIN)/python -m pytest -q -n 0 -m slow tests/cli/test_view_browser.py

# The lowest versions that pyproject.toml allows, in an environment of their own, and a sample of the tests on them.
lowest: $(READY)
	bash scripts/lowest_versions.sh $(BIN)/python

# Texts, reference from docstrings and the gallery of examples, which is run for it: build/docs/index.html.
docs: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	$(BIN)/python -m scripts.documentation_site build/docs

# Concealed cases from the independent model, diagnosed without their answers, then scored. Resumable.
STUDY ?= runs/study
study: $(READY)
	$(BIN)/python -m validation.generate --cases 200 --seed 7 -o $(STUDY)
	$(BIN)/python -m validation.run_study $(STUDY) $(STUDY)/results --jobs 2 --mesh coarse
	$(BIN)/python -m validation.score $(STUDY) $(STUDY)/results --json $(STUDY)/score.json

# The same for machines known roughly, for other machines and for networks: `make study_rough study_meridian study_networks`.
SEED ?= 50
study_%: $(READY)
	$(BIN)/python -m validation.generate_$* --cases 100 --seed $(SEED) -o runs/$@
	$(BIN)/python -m validation.run_study runs/$@ runs/$@/results --jobs 2 --mesh coarse
	$(BIN)/python -m validation.score_families runs/$@ runs/$@/results

# The verification and validation book. STUDY=folder names another concealed study, RECORDINGS another folder of
# real recordings; chapters without their data are left out by name. PEER_PYTHONS: interpreters with other solvers.
# EARLIER="folder folder": studies with other seeds to show beside it.
RECORDINGS ?= ../shared/recordings
EARLIER ?=
book: $(READY)
	test -d $(STUDY)/answers || $(MAKE) --no-print-directory study
	$(BIN)/python -m book -o reports/book --study $(STUDY) --recordings $(RECORDINGS) $(addprefix --earlier ,$(EARLIER))

# What was concealed and what was found, from finished studies: PROOF names their folders, with answers and results.
# REAL=folder: diagnoses of the real recordings (`python -m validation.open_examples` leaves them).
# BOOK=folder: the book's work, for the paper's riddle and other programs (`python -m book --only riddle --only peers`).
PROOF ?= runs/study_rough runs/study_meridian runs/study_networks
REAL ?=
BOOK ?=
proof: $(READY)
	$(BIN)/python -m validation.proof $(PROOF) -o reports/proof $(addprefix --real ,$(REAL)) $(addprefix --book ,$(BOOK)) \
	    --recordings $(RECORDINGS)

# Spoilt inputs, kills, full disks: at most half an hour on two cores, resumable; writes docs/reliability.md.
# HARDENING=short: a sample in a minute, without the page.
HARDENING ?= whole
hardening: $(READY)
	$(BIN)/python -m validation.hardening -o runs/hardening_$(HARDENING) --jobs 2 \
	    $(if $(filter short,$(HARDENING)),--short,--page docs/reliability.md)

clean:
	rm -rf $(VENV) build dist runs .pytest_cache .ruff_cache .hypothesis
