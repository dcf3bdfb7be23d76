"""Problems that are handed over: one's own, and values of columns on every path."""

import math

import casadi as ca
import numpy as np
import pytest
import sympy as sp
from structures import icosahedron, upright

import tensegrity as ts
from tensegrity import Prism, Problem, TensegrityError, equilibrium_path, plates, trace
from tensegrity.prisms.stack import symmetric_nodes

INF = math.inf
SOFT = Prism(1.0, 0.7, 0.1, 1.0, 20.0, 20.0)
RIGID = Prism(1.0, 0.7, 0.01, 1.0)

# --- the two-bar truss of half span 1 and rise 0.5, whose load is known in closed form -----------

RISE, NATURAL = 0.5, math.hypot(1, 0.5)
APEX = math.sqrt(NATURAL ** (2 / 3) - 1)  # of the limit points: dP/dw = 0 where L^3 = L0


def closed_load(w):
    return 2 * (NATURAL - np.hypot(1, w)) * w / np.hypot(1, w)


def symbolic():
    w, load = ca.SX.sym("w"), ca.SX.sym("load")
    length = ca.sqrt(1 + w**2)
    balance = 2 * (NATURAL - length) * w / length - load
    more = {"events": {"flat": w}, "columns": {"energy": (length - NATURAL) ** 2}}
    return Problem({"w": w, "load": load}, balance, start=(RISE, 0.0), **more)


def plain():
    return Problem(
        ("w", "load"),
        lambda u: [closed_load(u[0]) - u[1]],
        start=(RISE, 0.0),
        events={"flat": lambda u: u[0]},
        columns={"energy": lambda u: (np.hypot(1, u[0]) - NATURAL) ** 2},
    )


@pytest.mark.parametrize("problem", [symbolic, plain])
def test_a_truss_typed_by_hand_folds_at_the_closed_form_height(problem):
    path = trace(problem(), until={"w": -RISE}, at={"load": [0.01, 5.0], "energy": 0.005})
    assert path.end == "the requested w is reached"
    assert path.w[-1] == pytest.approx(-RISE, abs=1e-14)
    kinds = [event.kind for event in path.events]
    wanted = ["energy", "load", "fold", "load", "flat", "fold", "energy"]
    assert sorted(kinds) == sorted(wanted)
    assert [k for k in kinds if k != "energy"] == [k for k in wanted if k != "energy"]
    for event in path.events:
        if event.kind == "fold":
            assert abs(abs(event.w) - APEX) < (1e-14 if problem is symbolic else 1e-9)
        if event.kind == "load":
            assert abs(closed_load(event.w) - 0.01) < 1e-14
        if event.kind == "energy":
            assert event.energy == pytest.approx(0.005, rel=1e-12)
    assert np.abs(path.load - closed_load(path.w)).max() < 1e-14


def test_a_path_ends_at_the_first_event_of_a_kind():
    path = trace(symbolic(), until="first flat")
    assert path.end == "the first flat"
    assert abs(path.w[-1]) < 1e-15
    assert [event.kind for event in path.events] == ["fold", "flat"]
    assert [e.kind for e in trace(symbolic(), until="fold").events] == ["fold"]


@pytest.mark.parametrize("count", [1, 3])
def test_bifurcations_say_how_many_branches_leave(count):
    """v^3 = c v in each of several unknowns."""
    v, c = [ca.SX.sym(f"v{k}") for k in range(count)], ca.SX.sym("c")
    unknowns = {f"v{k}": x for k, x in enumerate(v)} | {"c": c}
    pitchforks = Problem(unknowns, [x**3 - c * x for x in v], start=[*[0.0] * count, -1.0])
    (event,) = trace(pitchforks, until={"c": 1.0}).events
    assert (event.kind, event.multiplicity) == ("bifurcation", count)
    assert abs(event.c) < 1e-12


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"until": {"height": 1.0}}, "until: column 'height' is not one of w, load, energy"),
        ({"at": {"load": "much"}}, "at load"),
        ({"until": {"w": np.nan}}, "until w is nan"),
        ({"at": [1.0]}, r"at \[1.0\] must be a dict"),
        ({"stop": ("nowhere",)}, "stop 'nowhere' is not among"),
    ],
)
def test_what_is_not_on_a_path_is_refused_by_name(given, message):
    with pytest.raises(TensegrityError, match=message):
        trace(symbolic(), **given)


def test_what_is_no_problem_is_refused():
    with pytest.raises(TensegrityError, match="problem"):
        trace("truss")
    with pytest.raises(TensegrityError, match="2 equations do not suit 2 unknowns, must be 1"):
        trace(Problem(("w", "load"), lambda u: u, start=(RISE, 0.0)))
    with pytest.raises(TensegrityError, match="must be a function"):
        Problem(("w", "load"), 3.0)
    with pytest.raises(TensegrityError, match="must be different names"):
        Problem(("w", "w"), lambda u: u[:1], start=(RISE, 0.0))
    w, stray = ca.SX.sym("w"), ca.SX.sym("stray")
    with pytest.raises(TensegrityError, match="stray: neither an unknown nor in p"):
        Problem({"w": w, "load": ca.SX.sym("load")}, [w * stray], start=(RISE, 0.0))
    with pytest.raises(TensegrityError, match="unknown w w is not a"):
        Problem({"w": sp.Symbol("w"), "load": w}, [w], start=(RISE, 0.0))


# --- prisms --------------------------------------------------------------------------------------

KINDS = {"elastic": (20.0, 20.0), "rigid bases": (INF, 20.0), "rigid bars": (20.0, INF)}
KINDS |= {"rigid": (INF, INF)}


@pytest.mark.parametrize("kind", KINDS)
def test_tensions_of_members_hold_every_node(kind):
    """Forces on an upper node, from positions alone: pulls of members and its part of the load."""
    for sides in (3, 5):
        prism = Prism(1.0, 0.7, 0.1, 1.0, *KINDS[kind], sides)
        path = equilibrium_path(prism, max_height=0.75)
        x = symmetric_nodes(sides, path.base, path.twist, path.height)
        ends = prism_ends(sides)
        top, size = sides, np.abs(path.load) + np.abs(path.cross_tension)
        force = np.zeros((len(path), 3))
        force[:, 2] = -path.load / sides
        for name, pairs in ends.items():
            for i, j in pairs:
                if top in (i, j):
                    away = x[:, j if i == top else i] - x[:, top]
                    pull = path.columns[f"{name}_tension"] / np.linalg.norm(away, axis=1)
                    force += pull[:, None] * away
        assert (np.abs(force).max(axis=1) <= 1e-9 * size).all()


def prism_ends(sides):
    s = Prism(1.0, 0.7, 0.1, 1.0, 20.0, 20.0, sides).structure()
    ends = s.ends.tolist()
    return {"bar": ends[:sides], "cross": ends[sides : 2 * sides], "base": ends[2 * sides :]}


@pytest.mark.parametrize("prism", [SOFT, RIGID])
def test_heights_at_given_loads_are_those_of_the_potential(prism):
    """Against bisection on the tension of the potential, which is found in another way."""
    loads = [0.05, 0.4, 1.2]
    path = equilibrium_path(prism, at={"load": loads})
    spring = prism.potential()
    found = [event for event in path.events if event.kind == "load"]
    assert [event.load for event in found][:3] == pytest.approx(loads, rel=1e-13)
    for event, load in zip(found, loads, strict=False):
        low, high = event.height - prism.height - 1e-3, event.height - prism.height + 1e-3
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (low, middle) if -spring.tension(middle) < load else (middle, high)
        assert abs(event.height - prism.height - middle) < 1e-10
        assert path.height[event.row] >= event.height >= path.height[event.row + 1]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["twist", "shortening", "cross_tension", "bar_tension", "load"])
def test_a_path_ends_at_a_value_of_any_column(kind, name):
    prism = Prism(1.0, 0.7, 0.5, 1.0, *KINDS[kind])
    value = float(equilibrium_path(prism).columns[name][6:8].mean())
    path = equilibrium_path(prism, until={name: value})
    assert len(path) == 8
    assert path.columns[name][-1] == pytest.approx(value, rel=1e-13)
    assert (np.diff(np.sign(path.columns[name][:-1] - value)) == 0).all()
    assert path.end == f"the requested {name} is reached"


def test_values_on_the_tension_side_are_found_as_well():
    path = equilibrium_path(SOFT, max_height=0.8, at={"height": [0.75, 0.72, 0.6]})
    assert [(e.kind, round(e.height, 12)) for e in path.events][:3] == [
        ("height", 0.75), ("height", 0.72), ("height", 0.6),
    ]  # fmt: skip
    for event in path.events[:3]:
        assert path.height[event.row] >= event.height >= path.height[event.row + 1]


def test_a_path_ends_at_the_first_event_of_a_kind_of_a_prism():
    path = equilibrium_path(SOFT, until="first fold")
    whole = equilibrium_path(SOFT)
    assert path.load[-1] == pytest.approx(whole.events[0].load, rel=1e-15)
    assert equilibrium_path(SOFT, until="slack").end == whole.end


# --- structures ----------------------------------------------------------------------------------


def arch(**more):
    """Two bars of stiffness 1 that snap through under a load, as above."""
    s = ts.Structure([[-1, 0], [1, 0], [0, RISE]], bars=[(0, 2), (1, 2)], k_bar=1.0)
    given = {"supports": ts.held([0, 1]) + ts.held([2], axes=[0]), "loads": {2: (0.0, -1.0)}}
    return equilibrium_path(s, **given, **more)


def test_a_load_is_met_on_all_three_branches_of_a_snap_through():
    path = arch(max_shortening=1.2, at={"load": 0.01})
    met = [event.shortening for event in path.events if event.kind == "load"]
    assert len(met) == 3
    assert np.abs(closed_load(RISE - np.array(met)) - 0.01).max() < 1e-13


def test_a_structure_stops_at_a_tension_and_at_the_first_slack_string():
    path = arch(until={"tension 0": -0.05})
    assert path.tensions[-1, 0] == pytest.approx(-0.05, rel=1e-13)
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    cross = ts.Structure(corners, [(0, 2), (1, 3)], [(0, 1), (1, 2), (2, 3), (3, 0)])
    stressed, press = cross.prestressed(prestrain={2: 0.05}), plates([0, 1], [2, 3])
    path = equilibrium_path(stressed, supports=press, until="first slack")
    assert path.end == "the first slack"
    assert path.events[-1].kind == "slack"
    natural = stressed.at(path.positions[-1]).lengths / stressed.natural_lengths
    assert abs(natural[[3, 5]] - 1).max() < 1e-12


def test_two_modes_of_a_column_are_lost_where_its_tangent_has_a_null_space_of_two():
    s = Prism(1.0, 0.7, 0.1, 1.0, 10.0, 100.0).column(2)
    low, up = [0, 1, 2], [6, 7, 8]
    path = equilibrium_path(
        s, supports=plates(low), loads={n: (0, 0, -1 / 3) for n in up}, branch="symmetric",
        until="first bifurcation",
    )  # fmt: skip
    (lost,) = path.events
    assert lost.multiplicity == 2
    values = s.at(path.positions[-1]).modes(6, plates(low)).eigenvalues
    assert (np.abs(values) < 1e-7 * values[-1]).sum() == lost.multiplicity


def test_events_of_later_pieces_lie_beyond_their_rows():
    path = equilibrium_path(
        upright(icosahedron(0.1)), supports=plates([0, 4, 8], [3, 7, 11]), branch="symmetric",
        max_shortening=1.6,
    )  # fmt: skip
    assert len(path.events) > 1
    for event in path.events:
        row = path.shortening[event.row : event.row + 2]
        assert row[0] <= event.shortening <= row[-1]


# --- orbits --------------------------------------------------------------------------------------


def test_an_orbit_is_met_on_all_three_branches_of_a_resonance():
    t, W = sp.symbols("t W")
    shaker = ts.Drive(force=0.001 * sp.cos(W * t), parameters={"W": 1.69})
    chain = ts.Chain(
        Prism(1.0, 0.7, 0.1, 1.0).potential(), 2, ends=("fixed", "free"),
        damping=ts.Damping(ground=0.02), drive={1: shaker},
    )  # fmt: skip
    first = ts.periodic_orbit(chain, chain.at_rest())
    path = ts.orbit_path(first, by="W", until=1.73, at={"W": 1.71})
    met = [event for event in path.events if event.kind == "W"]
    assert [event.W for event in met] == pytest.approx([1.71] * 3, rel=1e-13)
    shaker = ts.Drive(force=0.001 * sp.cos(W * t), parameters={"W": 1.71})
    chain = ts.Chain(chain.springs[0], 2, ends=chain.ends, damping=chain.damping, drive={1: shaker})
    again = ts.periodic_orbit(chain, chain.at_rest())
    assert min(abs(e.energy / again.energy - 1) for e in met) < 1e-9
    part = ts.orbit_path(first, by="W", until={"amplitude": met[0].amplitude})
    assert part.amplitude[-1] == pytest.approx(met[0].amplitude, rel=1e-12)
