"""Complete examples of units and pair laws, run as they are shown to users."""

import math

import pytest
import sympy as sp

import tensegrity

EXAMPLES = {
    "Kresling unit": """
h, f = sp.symbols("h f"); n, R = 6, 1.0
crease = lambda sign: sp.sqrt(h**2 + 4*R**2*sp.sin((f + sign*sp.pi/n)/2)**2)
unit = Unit([f], h, [Member(crease(-1), 1.0, n), Member(crease(1), 1.0, n)], rest={h: 1.8, f: 2*math.pi/9})
for state in unit.equilibria(): print(state.h, state.f, state.stable)
path = equilibrium_path(unit, min_height=0.7); print([e.load for e in path.events])
column = Chain(unit.pair(sites=(h, f)), sites=150, mass=(1.0, 0.5))
wave = solitary_wave(column, speed_ratio=1.003); print(wave.amplitude)
run = simulate(column, column.at_rest({0: (0.3, 0.0)}), t_end=50.0, tol=1e-9)
""",  # noqa: E501
    "X-module": """
w, h = sp.symbols("w h", positive=True)
cables, verticals = Member(w, 1.0, 2, string=True), Member(h, 2.0, 2, string=True)
bars = Member(sp.sqrt(w**2 + h**2), 50.0, 2)
unit = Unit([w], h, [cables, verticals, bars], rest={w: 1.0, h: 0.75}, prestrain={cables: 0.1})
print(unit.axial_stiffness())
path = equilibrium_path(unit, min_height=0.4); print([(e.kind, e.load) for e in path.events])
""",
    "rotating squares": """
kt, side = sp.Symbol("kt"), 2*math.cos(0.3)  # phases 1 and 0.5 to the square at the right and above
vectors, positions = [[0, 2*side], [side, -side]], [[0, 0], [side, 0]]
towards = {0: [(0, (0, 0)), (sp.pi/2, (0, -1))], 1: [(0, (1, 2)), (sp.pi/2, (1, 1))]}
(x, y, t), (X, Y, T) = first, second = sp.symbols("x y t"), sp.symbols("X Y T"); rho, beta = 1.0, 0.3
def hinge(d, s):
    at = lambda e, turn: rho*sp.Matrix([sp.cos(e + turn), sp.sin(e + turn)])
    move = sp.Matrix([X - x, Y - y]) + at(d + sp.pi - s*beta, T) - at(d + sp.pi - s*beta, 0) - at(d + s*beta, t) + at(d + s*beta, 0)
    return PairLaw(move.dot(move)/2 + kt*(T - t)**2/2, first, second, {kt: 0.01})
bonds = [(i, 1 - i, o, hinge(d, 1 - 2*i)) for i in (0, 1) for d, o in towards[i]]
lattice = PairLattice(vectors, positions, bonds, mass=(1.0, 1.0, 0.3))
print(bands(lattice, [[1.0, 0.5]]).frequencies)
""",  # noqa: E501
    "arch on hinges": """
x, h, kappa = sp.symbols("x h kappa"); rest = {x: 0.5, h: 0.5}
members = [Member(sp.sqrt(1 + x**2), 1.0, 2), Member(h - x, 0.5, natural=0.0)]
hinges = kappa*(sp.atan(x) - sp.atan(0.5))**2
unit = Unit([x], h, members, energy=hinges, parameters={kappa: 1e-3}, rest=rest)
for state in unit.equilibria(): print(state.h, state.energy, state.stable)
spring = unit.potential(); print(predict(spring))
chain = Chain(spring, 200); run = simulate(chain, chain.at_rest({0: 0.5}), 100.0, tol=1e-8)
by_hinge = gradient(objective.displacement(50), chain, chain.at_rest({0: 0.5}), 20.0, dt=0.05).by("kappa")
""",  # noqa: E501
    "formula": """
k, p, L = sp.symbols("k p L", positive=True); a, b, c = sp.symbols("a b c", positive=True)
s = lambda i, j: sp.sqrt(((L - j)/2)**2 + (L/2)**2 + (i/2)**2)
strings = [Member(s(*e), k, 8) for e in ((a, b), (b, c), (c, a))]
unit = Unit([b, c], a, strings, rest={a: L/2, b: L/2, c: L/2}, prestrain={strings[0]: p})
formula = unit.formula("axial stiffness"); print(formula.latex())
print(formula.c("stiffness")); formula.mathml()
""",
}


def ran(name):
    """What an example has made, after the imports."""
    names = {"math": math, "sp": sp} | {x: getattr(tensegrity, x) for x in tensegrity.__all__}
    exec(EXAMPLES[name], names)  # names of functions are looked up there
    return names


def test_a_kresling_unit_and_a_column_of_them():
    found = ran("Kresling unit")
    states = [(s.h, s.f, s.stable) for s in found["unit"].equilibria()]
    exact = [
        (1.8, 2 * math.pi / 9),
        (1.4124506921525, math.pi / 2),
        (0.76573115864789, 7 / 9 * math.pi),
    ]
    assert [s[:2] for s in states] == [pytest.approx(x, rel=1e-12) for x in exact]
    assert [s[2] for s in states] == [True, False, True]
    loads = [e.load for e in found["path"].events]
    assert loads == pytest.approx([0.20646787268761, -0.11521925214735], rel=1e-12)
    assert found["wave"].amplitude == pytest.approx((0.189619006139, 0.116295304143), rel=1e-10)
    assert found["run"].energy_error < 1e-7


def test_an_x_module_with_a_slack_string_and_a_limit_point():
    found = ran("X-module")
    assert found["unit"].axial_stiffness() == pytest.approx(4.8127068166777, rel=1e-12)
    events = [(e.kind, e.load) for e in found["path"].events]
    slack, fold = (
        pytest.approx(0.16071397505564, rel=1e-12),
        pytest.approx(0.20699407810486, rel=1e-12),
    )
    assert events == [("slack", slack), ("fold", fold)]


def test_bands_of_rotating_squares_at_two_phases():
    found = ran("rotating squares")
    frequencies = tensegrity.bands(found["lattice"], [[1.0, 0.5]]).frequencies[0]
    exact = 0.7775451585884, 0.8984573137737, 1.783176968521, 2.601795544538, 3.126132992068
    assert frequencies == pytest.approx([*exact, 4.669021704199], rel=1e-11)


def test_a_bistable_unit_of_ones_own_and_a_chain_of_it(capsys):
    found = ran("arch on hinges")
    states = [(s.h, s.energy, s.stable) for s in found["unit"].equilibria()]
    exact = (0.5, 0), (-0.0039619, 0.0141488), (-0.4962581, 8.57109e-4)
    assert [s[:2] for s in states] == [pytest.approx(x, rel=1e-5, abs=1e-12) for x in exact]
    assert [s[2] for s in states] == [True, False, True]
    assert "rarefaction waves" in capsys.readouterr().out
    assert found["run"].energy_error < 1e-6
    assert found["by_hinge"].any()


def test_the_stiffness_of_a_unit_as_latex_and_c(capsys):
    found = ran("formula")
    out = capsys.readouterr().out
    assert r"\frac{12 k p \left(4 p + 1\right)}{\left(p + 1\right) \left(12 p + 1\right)}" in out
    assert "double stiffness(double k, double p)" in out
    k, p = found["k"], found["p"]
    exact = 12 * k * p * (1 + 4 * p) / ((1 + p) * (1 + 12 * p))
    assert sp.simplify(found["formula"].expression - exact) == 0
