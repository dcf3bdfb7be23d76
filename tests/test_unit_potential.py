"""Potentials of units: against paths, the prism's own potential, and differences."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from units import arch, icosahedron, kresling, prism, snap_back, x_module

from tensegrity import (
    Chain,
    EquilibriumError,
    Member,
    Prism,
    Record,
    TensegrityError,
    Unit,
    equilibrium_path,
    gradient,
    objective,
    resume,
    simulate,
    solitary_wave,
)

ARCH = arch().potential()


def test_potential_of_a_prism_is_that_of_its_own_equations():
    """Strings carry compression in both, up to the twist at which base strings unload."""
    own = Prism(1.0, 0.7, 0.1, 1.0, 20.0, 20.0).potential()
    unit = prism(1.0, 0.7, 0.1, 20.0, 20.0).potential()
    r = np.linspace(-0.3, 0.15, 41)
    for name, error in (("energy", 1e-15), ("tension", 1e-14), ("stiffness", 1e-13),
                        ("stiffness_slope", 1e-11)):  # fmt: skip
        one, other = getattr(unit, name)(r), getattr(own, name)(r)
        assert np.abs(one - other).max() <= error * np.abs(other).max(), name
    assert unit.length == own.length


@pytest.mark.parametrize("unit", [x_module(), kresling(), icosahedron(50), x_module(sp.oo)])
def test_tension_is_minus_the_load_of_the_path(unit):
    spring = unit.potential()
    start = float(unit.rest[unit.control])
    path = equilibrium_path(unit, min_height=0.6 * start)
    slack = [e.row for e in path.events if e.kind == "slack"]
    smooth = path[: slack[0]] if slack else path
    r = getattr(smooth, str(unit.control)) - start
    inside = r > spring.domain[0]
    assert spring.tension(r[inside]) == pytest.approx(-smooth.load[inside], rel=1e-11, abs=1e-13)
    assert spring.energy(r[inside]) == pytest.approx(smooth.energy[inside], rel=1e-11, abs=1e-14)
    assert float(spring.stiffness(0.0)) == pytest.approx(unit.axial_stiffness(), rel=1e-11)


def test_energy_of_the_loop_is_the_integral_of_the_tension():
    """The law of the loop gives the energy, the iteration to the end the tension."""
    x, weights = np.polynomial.legendre.leggauss(200)
    low, high = ARCH.computable_domain
    for r in (0.9 * low, 0.3 * low, 0.4 * high):
        integral = r / 2 * weights @ ARCH.tension(r * (1 + x) / 2)
        assert ARCH.energy(r) == pytest.approx(integral, rel=1e-11)


def test_domain_ends_where_a_string_goes_slack_or_equilibrium_is_lost():
    cross = x_module().potential()
    assert cross.domain[0] == pytest.approx(0.71590909090909 - 0.75, rel=1e-11)
    assert cross.ends[0] == "the string h goes slack"
    snap = snap_back().potential()
    assert snap.domain[0] == pytest.approx(-0.59700371817851 - 0.5, rel=1e-12)
    assert snap.ends[0] == "equilibrium at given elongation is lost"


def test_preload_is_carried_at_rest_and_beyond_the_limit_point_refused():
    spring = arch().potential(preload=0.02)
    assert [float(f(0.0)) for f in (spring.energy, spring.tension)] == pytest.approx([0, 0])
    shift = spring.length - 0.5
    r = np.array([-0.1, 0.05])
    assert spring.tension(r) == pytest.approx(ARCH.tension(r + shift) + 0.02, rel=1e-12)
    assert float(ARCH.tension(shift)) == pytest.approx(-0.02, rel=1e-12)
    with pytest.raises(EquilibriumError, match=r"preload 1 N is beyond 0\.0432731 N"):
        arch().potential(preload=1.0)


def test_second_state_of_kresling_has_a_potential_of_its_own():
    unit = kresling()
    *_, second = unit.equilibria()
    spring = unit.potential(at=second)
    assert float(spring.stiffness(0.0)) == pytest.approx(0.50089079320546, rel=1e-11)
    assert spring.length == pytest.approx(second.h)


def test_chain_of_arches_keeps_its_energy_and_runs_alike_after_pickling():
    chain = Chain(ARCH, 30)
    start = chain.at_rest({0: 0.5})
    run = simulate(chain, start, 10.0, tol=1e-8)
    assert run.energy_error < 1e-9
    again = pickle.loads(pickle.dumps(chain))
    assert again == chain
    other = simulate(again, start, 10.0, tol=1e-10)
    assert other.final.u == pytest.approx(run.final.u, abs=1e-6)


def test_gradient_by_a_parameter_is_the_change_of_the_run():
    given = {"t_end": 10.0, "dt": 0.05}

    def final(kappa):
        chain = Chain(arch(kappa).potential(), 20)
        run = simulate(chain, chain.at_rest({0: 0.5}), **given, method="verlet",
                       record=Record(every=10**6))  # fmt: skip
        return run.final.u[5]

    chain = Chain(ARCH, 20)
    start = chain.at_rest({0: 0.5})
    found = gradient(objective.displacement(5), chain, start, **given)
    step = 1e-5
    change = (final(1e-3 + step) - final(1e-3 - step)) / (2 * step)
    assert found.by("kappa").sum() == pytest.approx(change, rel=1e-6)


def test_gradient_by_spring_constant_and_prestrain_keep_the_rest():
    """Of a cross of bars by symbols: each tension and natural length changes with them."""
    k, p = sp.symbols("k p", positive=True)
    w, h = sp.symbols("w h", positive=True)

    def unit(values):
        cables, posts = Member(w, 1, 2), Member(h, k, 2)
        bars = Member(sp.sqrt(w**2 + h**2), 500, 2)
        return Unit([w], h, [cables, posts, bars], parameters=values,
                    rest={w: 1, h: sp.Rational(3, 4)}, prestrain={cables: p})  # fmt: skip

    values, step = {k: 2.0, p: 0.1}, 1e-5
    given = {"t_end": 3.0, "dt": 0.02}

    def pair(**others):
        chain = Chain(unit(values | {x: others.get(str(x), y) for x, y in values.items()})
                      .potential(), 2)  # fmt: skip
        return chain, chain.at_rest({0: 0.1})

    chain, start = pair()
    quantities = [objective.displacement(1), objective.impulse(0)]
    found = gradient(quantities, chain, start, **given)
    for symbol, value in values.items():
        ends = [gradient(quantities, *pair(**{str(symbol): value + x}), **given)
                for x in (-step, step)]  # fmt: skip
        for one, low, high in zip(found, *ends, strict=True):
            change = (high.value - low.value) / (2 * step)
            assert one.by(str(symbol)).sum() == pytest.approx(change, rel=1e-7)


def test_solitary_wave_of_arches_is_one_of_extension():
    wave = solitary_wave(ARCH, speed_ratio=1.02)
    assert wave.residual < 1e-11
    assert wave.amplitude > 0


def test_varied_springs_have_other_parameters():
    assert ARCH.varied({"kappa": 0.002}) == arch(0.002).potential()
    assert ARCH.varied({"preload": 0.01}) == arch().potential(preload=0.01)
    assert ARCH.parameters == {"kappa": 0.001, "preload": 0.0}
    with pytest.raises(TensegrityError, match=r"'k' is not an argument of .* kappa, preload"):
        ARCH.varied({"k": 1.0})


def held(k, preload):
    """A spring whose state at rest moves with k."""
    x, h, s = sp.symbols("x h k", positive=True)
    members = [Member(sp.sqrt(3 + x**2), s, natural=3), Member(x, 1, natural=sp.Rational(1, 2)),
               Member(h, 1, natural=1)]  # fmt: skip
    energy = (h - x) ** 2
    at = sp.nsolve([2 * (h - x) + h - 1,
                    k * (1 - 3 / sp.sqrt(3 + x**2)) * x + x - 0.5 - 2 * (h - x)],
                   [x, h], [1, 1], prec=30) if k != 1 else (1, 1)  # fmt: skip
    unit = Unit([x], h, members, energy, {s: k}, {x: at[0], h: at[1]})
    return unit.potential(preload)


def creased(k, R, preload):
    """Kresling creases about their second state, which is that of a closed form."""
    stiffness, size = sp.symbols("k R", positive=True)
    unit = replace(kresling(stiffness, 1, radius=size), parameters={"k": k, "R": R})
    low = np.sqrt(1.8**2 - 4 * np.cos(2 * np.pi / 9) * np.cos(np.pi / 6))
    return unit.potential(preload, at={"h": R * low, "f": 7 * np.pi / 9})


SPRINGS = {
    "rest that moves": (held, {"k": 1.0, "preload": 0.0}),
    "loaded": (held, {"k": 1.0, "preload": 0.05}),
    "second state": (creased, {"k": 1.0, "R": 1.0, "preload": 0.0}),
    "second state, loaded": (creased, {"k": 1.0, "R": 1.0, "preload": 0.01}),
    "arch, loaded": (lambda kappa, preload: arch(kappa).potential(preload),
                     {"kappa": 1e-3, "preload": 0.01}),
    "prism": (lambda preload, **x: Prism(**x).potential(preload),
              {"base": 1.0, "height": 0.7, "prestrain": 0.1, "k_cross": 2.0, "k_base": 8.0,
               "k_bar": 20.0, "preload": 0.05}),
    "prism of rigid bases": (lambda preload, **x: Prism(**x, sides=4).potential(preload),
                             {"base": 1.2, "height": 0.7, "prestrain": 0.1, "k_cross": 2.0,
                              "k_bar": 20.0, "preload": 0.01}),
}  # fmt: skip


@pytest.mark.parametrize("name", SPRINGS)
def test_derivatives_of_springs_are_changes_about_the_state_at_rest(name):
    """Of energy and tension, by spring constants, geometry and preload; differences of order 4."""
    make, values = SPRINGS[name]
    spring, r = make(**values), 0.02
    for one, value in values.items():
        step = 1e-3 * (value or 0.1)
        at = [make(**values | {one: value + k * step}) for k in (-2, -1, 1, 2)]
        found = spring.law.by_parameters(r, spring.values)
        for quantity, by in zip(("energy", "tension"), found, strict=True):
            a, b, c, d = (float(getattr(x, quantity)(r)) for x in at)
            change = (a - 8 * b + 8 * c - d) / (12 * step)
            slope = float(np.array(by).ravel() @ spring.slopes(one))
            assert slope == pytest.approx(change, rel=1e-8, abs=1e-10), (one, quantity)


def test_gradients_of_a_chain_of_elastic_prisms_are_the_changes_of_its_run():
    values = {"base": 1.0, "height": 0.7, "prestrain": 0.1, "k_base": 8.0, "preload": 0.05}

    def found(**others):
        given = values | others
        spring = Prism(k_cross=2.0, **{k: x for k, x in given.items() if k != "preload"})
        chain = Chain(spring.potential(given["preload"]), 4)
        start = chain.at_rest({0: 0.05})
        return gradient(objective.displacement(2), chain, start, t_end=3.0, dt=0.05)

    slopes = found()
    for name, value in values.items():
        low, high = (found(**{name: value * x}).value for x in (1 - 1e-4, 1 + 1e-4))
        assert slopes.by(name).sum() == pytest.approx((high - low) / (2e-4 * value), rel=1e-6)


@pytest.mark.parametrize("kind", ["unit", "pair"])
def test_interrupted_runs_of_units_go_on_from_their_files(kind, tmp_path):
    """Files hold neither; they know the scene by its contents, whatever was asked of it before."""

    def scene():
        if kind == "unit":
            return Chain(arch().potential(), 6)
        return Chain(kresling().pair(sites=("h", "f")), 6, mass=(1.0, 0.5))

    chain = scene()
    assert chain == scene() == pickle.loads(pickle.dumps(chain))
    start = chain.at_rest({0: 0.1 if kind == "unit" else (0.1, 0.0)})
    given = {"t_end": 2.0, "dt": 0.01, "method": "rkn6"}
    record = Record(every=10, path=tmp_path / "rows.npy", checkpoint=0)
    simulate(chain, start, **given, record=record, observe=lambda t, *_: t > 1)
    whole = simulate(chain, start, **given, record=Record(every=10))
    assert np.array_equal(resume(record.path, scene()).u, whole.u)
    with pytest.raises(TensegrityError, match="cannot be built from a file: give it as `scene`"):
        resume(record.path)


def test_units_are_printed_briefly_and_shown_whole():
    unit = x_module()
    assert repr(unit) == f"Unit(3 members, coordinates w, h, {unit.contents[:8]})"
    lines = str(unit).splitlines()
    assert lines[0] == "unit with h given, w in equilibrium"
    assert "  string 0: 2 of length w, k 1, prestrain 0.1" in lines
    assert "  rest: w = 1, h = 0.75" in lines
    assert "k 50" in unit._repr_html_()
    assert x_module(49).contents != unit.contents
