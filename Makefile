# `make figures` and `make test` need Python 3.11 or newer and make; they set up .venv themselves,
# with a C compiler from a package, ziglang, where there is none, keep it while pyproject.toml is
# unchanged and rebuild it when it is not.  Each target adds the extras that it needs.

PYTHON := $(shell for p in python3.11 python3.12 python3.13 python3.14 \
	python3; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && \
	echo $$p && break; done)
BIN = .venv/bin
INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check --editable
READY = .venv/ready

.PHONY: figures derivations derived live test quick test-slow readers faults bench site site-test \
	lint clean

figures: $(READY)
	$(BIN)/python -m figures

.PHONY: gallery pictures help
gallery: $(READY)
	$(BIN)/python -m figures --all

# What README and site show, under version control: draw it again, with what is stored for it.
pictures: $(READY)
	$(BIN)/python -m figures --update $(filter-out benchmark_%,$(basename $(notdir \
		$(wildcard docs/pictures/*.png))))

define HELP
make figures       the 13 main pictures, in a minute or two, in figures/output
make gallery       all pictures, slow ones last; goes on where it was stopped
make derivations   every formula, derived and checked, as a page
make site          guide, gallery and reference, in docs/_build/site
make live          a page in which a chain runs
make test          the tests; `make quick` some of them, `make test-slow` the slow ones
make readers       files, read back by VTK, ASE and MuJoCo
make site-test     the site with a few pictures, opened in a browser
make derived      derive what comes with the package, after a change of its sources
make faults        how many faults, put into a copy of the code, the tests notice; hours
make lint          ruff and mypy
make bench         benchmarks against other programs
make pictures      refresh docs/pictures, which README and site show
make clean         remove .venv and what was built
endef
export HELP
help:
	@echo "$$HELP"

derivations: $(READY)
	$(BIN)/python -m derivations --output derivations/output

# One page with a chain that runs in it: docs/live/output/index.html.
live: .venv/with-cc
	$(BIN)/python -m docs.live

# Two processes, each with one thread of linear algebra: the matrices are small.
test: .venv/with-test
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -rs -m "not slow" -n 2 --dist worksteal

# What one runs after each edit, in a minute: every room by some of its tests.
QUICK = golden house layers one_engine network network_energies ensemble driven following methods \
	record_times clearance lattice continuation response prism structure waves forces \
	forces_following shape archive network_orbits granular_contact granular_layout \
	gradient_input gradient_networks search
RESUMED = tests/test_resume.py::test_an_interrupted_run_goes_on_to_the_same_bits
quick: .venv/with-test
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -m "not slow" -n 2 --dist worksteal \
		$(QUICK:%=tests/test_%.py) $(RESUMED)

test-slow: .venv/with-test
	$(BIN)/python -m pytest -m slow

# Files read back by programs that are large: VTK, ASE, MuJoCo.
readers: .venv/with-test .venv/with-readers
	$(BIN)/python -m pytest -rs tests/test_file_readers.py

# Derivations of known laws, which come with the package: tensegrity/engine/derived.gz.
derived: .venv/with-test
	$(BIN)/python -m granular.derived

# Breaks a copy of the code at random places, one at a time, and counts what tests notice; hours.
faults: .venv/with-test
	$(BIN)/python -m tests.faults

# The site, in docs/_build/site: open index.html there.  It shows the pictures that were made.
site: .venv/with-site
	@$(BIN)/python -m docs.live || echo "without a live chain"
	$(BIN)/python -m sphinx --quiet --fail-on-warning --keep-going -b html docs docs/_build/site
	@echo "docs/_build/site/index.html"

# Every page of it in a browser, with a few pictures that take seconds; the live chain against Python.
site-test: .venv/with-test
	$(BIN)/python -m figures start constitutive_rigid granular_fig2 wave_power_law
	$(MAKE) site
	$(BIN)/python -m pytest -rs tests/test_site.py tests/test_live.py tests/test_live_page.py

bench: .venv/with-bench
	$(BIN)/python -m benchmarks

lint: .venv/with-lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The copy of pyproject.toml says for which one the environment was made: comparing content, a
# fresh checkout of the same file costs nothing.
$(READY): pyproject.toml
	@if cmp -s pyproject.toml $(READY); then touch $(READY); else \
		test -n "$(PYTHON)" || { echo "Python 3.11 or newer, with venv, not found"; exit 1; }; \
		echo "setting up .venv"; rm -rf .venv && $(PYTHON) -m venv .venv && \
		$(INSTALL) . && \
		{ for one in $${CC:-cc gcc clang}; do command -v $$one >/dev/null && break; done || \
		{ echo "no C compiler: installing ziglang" && \
		$(INSTALL) '.[cc]'; }; } && \
		cp pyproject.toml $(READY); fi

# An extra of pyproject.toml, by the same rule: what was installed goes with .venv.
.venv/with-%: $(READY)
	@if cmp -s pyproject.toml $@; then touch $@; else \
		echo "installing what is for $*" && $(INSTALL) '.[$*]' && cp pyproject.toml $@; fi

clean:
	rm -rf .venv build *.egg-info docs/_build docs/_made
