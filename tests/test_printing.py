"""What `print` shows of every kind of object: 80 columns, six digits, units."""

import re

import numpy as np
import pytest
import sympy
from networks import patch
from scenes import prism_chain, smooth_blow
from structures import icosahedron

import granular
from granular.design import Choice, Order, Sizes, robustness, search
from tensegrity import (
    METHODS,
    Chain,
    Damping,
    Drive,
    Ensemble,
    Force,
    Polynomial,
    Potential,
    PowerLaw,
    Prism,
    Record,
    State,
    Wall,
    bands,
    bar_contact,
    budget,
    catalogue,
    equilibrium,
    equilibrium_path,
    fit,
    floquet,
    gradient,
    held,
    interface,
    modes,
    moduli,
    objective,
    orbit_path,
    periodic_orbit,
    plates,
    predict,
    pulses,
    simulate,
    solitary_wave,
    transition_wave,
    transmission,
)
from tensegrity.printing import WIDTH, filled, span

THIRD = 1 / 3
STEEL = granular.materials["steel"]
BEAD = granular.Bead(THIRD / 100, STEEL)
STRIKER = granular.Striker(BEAD, THIRD)
PRISM = Prism(1.0, 0.7, THIRD / 10, 10 * THIRD)
ELASTIC = Prism(1.0, 0.7, THIRD / 10, 10 * THIRD, k_base=100 * THIRD, k_bar=1000 * THIRD)
CHAIN = prism_chain(30)
RUN = simulate(CHAIN, smooth_blow(CHAIN), 20.0, dt=0.1, record=Record(every=1))
PLATES = plates([0, 1, 2], [3, 4, 5])
R = sympy.Symbol("r")
SOFT = Potential(R**2 / 2, R)
WELLS = Potential(R**4 / 4 - 1.35 * R**3 / 3 + 0.35 * R**2 / 2, R)
DASHPOTS = Damping(ground=0.3)
LATTICE = catalogue.octahedra(k_bar=20 * THIRD)
SMALL = granular.Bead(THIRD / 200, STEEL)
IMPACT = {"striker": STRIKER, "wall": STEEL, "t_end": 1e-3}
LOSSY = granular.kuwabara_kono(restitution=0.9, speed=THIRD)
LOADED = granular.fcc_pack(2, 3, bead=BEAD, floor=STEEL, sides=STEEL, gravity=9.81)


def path():
    return equilibrium_path(ELASTIC)


def fitted():
    found = path()
    part = slice(1, 20)
    return fit(found.shortening[part], found.load[part], ELASTIC, ("prestrain",), noise=1e-5)


def of_a_load():
    return gradient(objective.peak(objective.load(bond=9)), CHAIN, smooth_blow(CHAIN), 9.0, dt=0.1)


def orbit():
    x = np.arange(20) - 9.5
    guess = State(0.02 * np.sin(np.pi * x) / np.cosh(0.63 * x), 0 * x)
    stiff = Prism(1.0, 0.7, 0.1, 1.0).potential()
    return periodic_orbit(Chain(stiff, 20), guess, period=1 / 0.557)


def response():
    t, w = sympy.symbols("t W")
    shaker = Drive(force=1e-4 * sympy.cos(w * t), parameters={"W": THIRD / 2})
    chain = Chain(SOFT, 2, ends=("fixed", "free"), damping=DASHPOTS, drive={1: shaker})
    return periodic_orbit(chain, chain.at_rest())


def crossed():
    near, far = (Prism(1.0, 0.8, prestrain, 1.0).potential() for prestrain in (0.1, 0.02))
    chain, wave = interface(near, far, (60, 60)), solitary_wave(near, speed_ratio=1.2)
    return transmission(simulate(chain, wave.launch(chain, at=30.0), 32 / wave.speed, tol=1e-6))


def struck(scene):
    return simulate(scene, scene.at_rest({0: THIRD / 10}), 1e-4, dt=1e-6)


READS_BACK = {  # the repr of these has all digits
    "prism": lambda: ELASTIC,
    "potential": lambda: ELASTIC.potential(preload=THIRD),
    "power law": lambda: PowerLaw(THIRD, 1.5, preload=THIRD, length=1.0),
    "energy": lambda: Potential(sum(THIRD * R**n for n in range(2, 9)), R, {}),
    "polynomial": lambda: Polynomial(PRISM.potential(), -THIRD / 10, THIRD / 10, 1e-6),
    "chain": lambda: CHAIN,
    "network": lambda: patch(3),
    "ensemble": lambda: Ensemble(granular.chain([BEAD] * 4, striker=STRIKER), 3),
    "record": lambda: Record(times=np.linspace(0, THIRD, 99), sites=range(50)),
    "damping": lambda: Damping(THIRD, [THIRD] * 30),
    "drive": lambda: Drive(force=THIRD * sympy.sin(THIRD * sympy.Symbol("t"))),
    "wall": lambda: Wall((THIRD, THIRD), (0, 1)),
    "supports": lambda: plates(range(0, 30, 2), range(1, 30, 2)) + held(range(30, 60)),
    "material": lambda: STEEL,
    "bead": lambda: BEAD,
    "striker": lambda: STRIKER,
    "contact": lambda: granular.hertz(BEAD, BEAD),
    "chain of beads": lambda: granular.chain([BEAD] * 4, striker=STRIKER, end=STEEL),
    "guide": lambda: granular.diamond_guide(3, 5, bead=BEAD),
    "pack": lambda: LOADED,
    "order": lambda: Order([BEAD] * 10 + [granular.Bead(0.005, STEEL)] * 10),
    "choice": lambda: Choice(20, 0.005, list(granular.materials.values())),
    "sizes": lambda: Sizes(20, (0.004, THIRD / 50), 0.1 + THIRD / 100, STEEL),
}
RESULTS = {
    "run": lambda: RUN,
    "state": lambda: RUN.final,
    "path": path,
    "path of a structure": lambda: equilibrium_path(
        ELASTIC.structure(), supports=PLATES, max_shortening=0.05
    ),
    "event": lambda: path().events[0],
    "structure": lambda: icosahedron(),
    "equilibrium": lambda: equilibrium(ELASTIC.structure(), {3: (0, 0, -THIRD / 100)}, PLATES),
    "modes of a structure": lambda: icosahedron().modes(9),
    "modes": lambda: modes(CHAIN, count=12),
    "self-stress": lambda: icosahedron().self_stress(),
    "rest": lambda: LOADED.equilibrium,
    "wave": lambda: solitary_wave(CHAIN.springs[0], speed_ratio=1.5),
    "prediction": lambda: predict(CHAIN.springs[0]),
    "family": lambda: predict(CHAIN.springs[0]).families[0],
    "fit": fitted,
    "gradient": of_a_load,
    "pulse": lambda: pulses(RUN)[0],
    "budget": lambda: budget(RUN, 9),
    "objective": lambda: objective.peak(objective.load(bond=9)),
    "lattice": lambda: LATTICE,
    "bands": lambda: bands(LATTICE, [[0.1, THIRD, 0.0], [1.0, 1.0, 1.0]]),
    "moduli": lambda: moduli(LATTICE),
    "moduli of a column": lambda: moduli(ELASTIC.column(periodic=True)),
    "stability of a lattice": lambda: LATTICE.stability(),
    "stability of a wave": lambda: floquet(solitary_wave(CHAIN.springs[0], speed_ratio=1.5)),
    "orbit": orbit,
    "stability of an orbit": lambda: floquet(orbit()),
    "path of orbits": lambda: orbit_path(response(), by="W", until=THIRD),
    "front": lambda: transition_wave(SOFT, ahead=0.0, behind=1.0, ground=WELLS, damping=DASHPOTS),
    "transmission": crossed,
    "curve of a family": lambda: predict(CHAIN.springs[0])["compression"].curve(points=5),
    "rows of a path": lambda: path()[:3],
    "robustness": lambda: robustness([BEAD] * 4, gaps=1e-6, draws=4, **IMPACT),
    "design": lambda: search(Order([BEAD] * 4 + [SMALL] * 4), **IMPACT, budget=64),
    "batch": lambda: struck(Ensemble(CHAIN, 3)),
    "energies of beads": lambda: granular.energies(struck(granular.chain([BEAD] * 4))),
}
SHORT = {  # tuples, methods and laws, whose repr is that of Python
    "natural lengths": lambda: ELASTIC.natural_lengths(),
    "contact of bars": lambda: bar_contact(path(), THIRD / 10),
    "method": lambda: METHODS["rkn6"],
    "Nystrom method": lambda: METHODS["rk4"],
    "materials": lambda: granular.materials,
    "dissipation": lambda: granular.chain([BEAD] * 3, law=LOSSY).contacts[0],
    "force": lambda: Force(-THIRD * sympy.Symbol("v"), at=range(9)),
}
NUMBER = re.compile(r"(?<![\w.])\d+\.\d+")


def checked(text):
    assert max(map(len, text.splitlines())) <= WIDTH, text
    for number in NUMBER.findall(text):
        assert len(number.replace(".", "").lstrip("0")) <= 6, text


@pytest.mark.parametrize("name", [*READS_BACK, *RESULTS, *SHORT])
def test_what_is_printed_fits_80_columns_with_six_digits(name):
    thing = (READS_BACK | RESULTS | SHORT)[name]()
    checked(str(thing))
    if name in RESULTS:
        checked(repr(thing))


def test_an_engineer_reads_displacements_tensions_and_slack():
    structure = ELASTIC.structure()
    found = equilibrium(structure, {3: (0, 0, -0.01)}, PLATES)
    moved = np.linalg.norm(found.positions - structure.positions, axis=1).max()
    text = str(found)
    assert f"displacements up to {moved:.6g} m" in text
    assert f"tensions {found.tensions.min():.6g} to {found.tensions.max():.6g} N" in text
    assert "slack strings: none" in text
    ball = icosahedron()
    squeezed = ball.at(ball.positions * [1, 1, 0.8])
    numbers = ", ".join(map(str, np.flatnonzero(squeezed.slack)))
    assert f"slack: strings {numbers}" in str(squeezed)
    assert str(ball.modes(3)).startswith("modes 1 to 3 of 30, without rigid motions")
    assert str(modes(CHAIN, count=2)).startswith("modes 1 to 2 of 30\n")
    stress = ball.self_stress()
    assert str(stress).startswith(f"{len(stress.states)} state of self-stress of 30 members")


def test_lines_break_between_a_number_and_its_unit_never():
    text = filled("  " + "tension 12 N, " * 20)
    assert all(line.startswith("      ") for line in text.splitlines()[1:])
    assert all("12 N" in line for line in text.splitlines())
    assert not any(line.endswith("12") for line in text.splitlines())
    assert " ".join(text.split()) == " ".join(("tension 12 N, " * 20).split())


def test_round_off_is_printed_as_zero():
    """Of the largest entry, of the stress by the stiffness, and of the coupling of two twists."""
    column = catalogue.column(periodic=True)
    found = moduli(column)
    assert 0 < abs(found.coupling) < 1e-12  # what is computed stays
    words = str(found)
    assert "coupling 0 N m" in words
    assert "e-1" not in words
    assert span([-1e-13, 1.0], "m") == "0 to 1 m"
    assert span([-1e-11, 1.0]) == "-1e-11 to 1"
