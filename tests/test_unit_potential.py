"""Potentials of units: against paths, the prism's own potential, and differences."""

import pickle

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


def test_derivatives_that_would_move_the_rest_are_refused():
    with pytest.raises(TensegrityError, match="the state would move"):
        arch().potential(preload=0.01).slopes("kappa")
    x, h, k = sp.symbols("x h k", positive=True)
    held = Unit([x], h, [Member(x, k, natural=2), Member(x, 1, natural=0), Member(h, 1)],
                (h - x) ** 2, {k: 1.0}, {x: 1, h: 1})  # fmt: skip
    with pytest.raises(TensegrityError, match="the rest of the unit moves with k"):
        held.potential().slopes("k")
