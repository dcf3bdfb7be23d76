"""Gradients of chains: against references, complex steps and identities that need no other code."""

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from complex_steps import derivative, line, run, tension_of
from hypothesis import given, settings
from hypothesis import strategies as st

from tensegrity import Chain, Ensemble, Potential, PowerLaw, Prism, State, gradient, simulate
from tensegrity import objective as o

REFERENCES = json.loads((Path(__file__).parent / "gradients.json").read_text())["scenes"]
METHODS = ("verlet", "rkn6")
STEPS = {"dt": 0.05, "method": "rkn6"}
R, K, A = sp.symbols("r k a")
ENERGY = K * R**2 / 2 + A * R**3 / 3 + R**4 / 4
ARGUMENTS = {"alpha": "stiffness"}


def springs_of(law, names, rows):
    if law == "hertz":
        return [PowerLaw(*row, 1.5) for row in rows]
    if law == "prism":
        return [Prism(1.0, h, p, k).potential() for p, h, k in rows]
    symbols = sp.symbols(names)
    energy = sum(s * R ** (i + 2) / (i + 2) for i, s in enumerate(symbols))
    return [Potential(energy, R, dict(zip(symbols, row, strict=True))) for row in rows]


def reference_scene(scene):
    rows = np.array(scene["p"], dtype=float)
    ends = ("free", "fixed" if scene["held"] else "free")
    springs = springs_of(scene["law"], scene["pnames"], rows)
    chain = Chain(springs, len(scene["u"]), np.array(scene["m"], dtype=float), ends)
    return chain, State(np.array(scene["u"], dtype=float), np.array(scene["v"], dtype=float))


def objectives(chain, site, held):
    """Those of the references, by name; and the sites of the kinetic energy."""
    last, sites = (
        chain.sites - 2,
        [s for s in range(chain.sites // 2, chain.sites) if s not in held],
    )
    mass = chain.mass[sites]

    def kinetic(t, y):
        slope = np.zeros_like(y)
        slope[:, -1] = mass * y[:, -1]
        return mass @ y[:, -1] ** 2 / 2, slope

    return {
        "u_site": o.displacement(site),
        "v_site": o.velocity(site),
        "kinetic_right_half": o.of([o.velocity(s) for s in sites], kinetic),
        "impulse_last_bond": o.impulse(bond=last),
        "pnorm16_last_bond": o.p_norm(o.load(bond=last), 16),
    }, sites


def groups(found, wanted, explicit):
    """{group: (entries of the gradient, entries of the reference)}."""
    pairs = {}
    known = {"u0": found.u, "v0": found.v, "mass": found.mass + explicit}
    for key, value in wanted.items():
        group, place = key.rstrip("]").split("[")
        if group not in known:
            known[group] = found.by(ARGUMENTS.get(group, group))
        entry = known[group][int(place.removeprefix("bond "))]
        pairs.setdefault(group, []).append((entry, float(value)))
    return {group: np.transpose(pair) for group, pair in pairs.items()}


@pytest.mark.parametrize("checkpoints", [None, 10])
@pytest.mark.parametrize("name", REFERENCES)
def test_gradients_are_the_references_of_ninety_digits(name, checkpoints):
    reference, scene = REFERENCES[name], REFERENCES[name]["scene"]
    chain, state = reference_scene(scene)
    asked, sites = objectives(chain, scene["site"], scene["held"])
    dt = float(scene["dt"])
    t_end = scene["steps"] * dt
    found = gradient(
        list(asked.values()),
        chain,
        state,
        t_end,
        dt=dt,
        method=scene["method"],
        checkpoints=checkpoints,
    )
    touching = scene["law"] == "hertz" and checkpoints is None
    for key, one in zip(asked, found, strict=True):
        assert one.value == pytest.approx(float(reference["values"][key]), rel=1e-12)
        explicit = np.zeros(chain.sites)  # of masses in the function itself, which it hides
        if key == "kinetic_right_half":
            explicit[sites] = one.run.final.v[sites] ** 2 / 2
        for group, (mine, exact) in groups(one, reference["gradients"][key], explicit).items():
            bound = 1e-5 if touching and group in ("u0", "v0") else 1e-10
            assert np.abs(mine - exact).max() < bound * np.abs(exact).max(), (key, group)
        assert one.reversal < 1e-12


def chains(draw):
    sites = draw(st.integers(3, 6))
    numbers = st.floats(0.5, 2.0)
    k, a = (np.array(draw(st.lists(numbers, min_size=sites - 1, max_size=sites - 1)))
            for _ in range(2))  # fmt: skip
    mass = np.array(draw(st.lists(numbers, min_size=sites, max_size=sites)))
    small = st.floats(-0.1, 0.1)
    u, v = (np.array(draw(st.lists(small, min_size=sites, max_size=sites))) for _ in range(2))
    fixed = draw(st.booleans())
    if fixed:
        u[-1] = v[-1] = 0
    return k, a - 1, mass, u, v, fixed


@settings(max_examples=8, deadline=None)
@given(st.composite(chains)(), st.sampled_from(METHODS), st.integers(0, 2))
def test_gradients_of_any_chain_are_those_of_complex_steps(scene, method, kind):
    k, a, mass, u, v, fixed = scene
    tension, dt, steps = tension_of(ENERGY, R, K, A), 0.1, 40
    springs = [Potential(ENERGY, R, {"k": x, "a": y}) for x, y in zip(k, a, strict=True)]
    chain = Chain(springs, len(u), mass, ("free", "fixed" if fixed else "free"))
    trace = [o.displacement(1), o.velocity(1), o.load(bond=1)][kind]
    rng = np.random.default_rng(1)
    weights = rng.standard_normal(steps + 1)
    asked = o.of([trace], lambda t, y: (float(weights @ y[0]), weights[None]))
    found = gradient(asked, chain, State(u, v), steps * dt, dt=dt, method=method)

    def value(k=k, a=a, mass=mass, u=u, v=v):
        w = 1 / np.asarray(mass)
        w[-1] *= not fixed
        x, y = run(line(tension, (k, a), w), u, v, method, dt, steps)
        return weights @ [x[:, 1], y[:, 1], -tension(x[:, 2] - x[:, 1], k[1], a[1])][kind]

    assert found.value == pytest.approx(value(), rel=1e-11, abs=1e-13)
    moving = range(len(u) - fixed)
    for mine, name, array, places in (
        (found.u, "u", u, moving), (found.v, "v", v, moving), (found.mass, "mass", mass, moving),
        (found.by("k"), "k", k, range(len(k))), (found.parameters["a"], "a", a, range(len(k))),
    ):  # fmt: skip
        exact = [derivative(lambda x, n=name: value(**{n: x}), array, i) for i in places]
        scale = max(np.abs(exact).max(), 1e-3)
        assert np.abs(mine[list(places)] - exact).max() < 1e-10 * scale, name


def prisms(prestrains=(0.01, 0.02, 0.05, 0.03), preload=0.001, ends=("free", "fixed")):
    springs = [Prism(1.0, 0.7, p, 1.0).potential(preload) for p in prestrains]
    return Chain(springs, len(springs) + 1, np.linspace(1, 2, len(springs) + 1), ends)


@pytest.mark.parametrize("method", METHODS)
def test_traces_and_numbers_of_them_are_differentiated_as_finite_differences_say(method):
    chain = prisms()
    state, t_end, dt = chain.at_rest({0: 0.05}), 10.0, 0.1
    asked = [
        o.peak(o.load(bond=2)), o.p_norm(o.velocity(2), 4, over=(2, 8)), o.arrival(3, 1e-3),
        o.energy([1, 2]), o.misfit(o.displacement(1), [1.03, 7.9, 9.99], [0.1, 0.0, 0.2]),
        o.p_norm(o.energy([2]), 3), o.impulse(wall=0),
    ]  # fmt: skip

    def values(chain, state):
        found = gradient(asked, chain, state, t_end, dt=dt, method=method, wanted=())
        return np.array([one.value for one in found])

    def difference(moved, h=1e-6):
        return (values(*moved(h)) - values(*moved(-h))) / (2 * h)

    found = gradient(asked, chain, state, t_end, dt=dt, method=method)
    place = np.eye(5)[1]

    def other(k, **changed):
        def moved(h):
            kept = {"height": 0.7, "prestrain": (0.01, 0.02, 0.05, 0.03)[k], "k_cross": 1.0}
            kept = {name: x + h * (name in changed) for name, x in kept.items()}
            springs = [*chain.springs]
            springs[k] = Prism(base=1.0, **kept).potential(0.001)
            return Chain(springs, 5, chain.mass, chain.ends), state

        return moved

    cases = {
        "u": (lambda h: (chain, State(state.u + h * place, state.v)), lambda g: g.u[1]),
        "v": (lambda h: (chain, State(state.u, state.v + h * place)), lambda g: g.v[1]),
        "mass": (lambda h: (Chain(chain.springs, 5, chain.mass + h * place, chain.ends), state),
                 lambda g: g.mass[1]),
        **{name: (other(k, **{name: 1}), lambda g, n=name, k=k: g.by(n)[k])
           for name, k in (("prestrain", 0), ("height", 1), ("k_cross", 2))},
    }  # fmt: skip
    for name, (moved, mine) in cases.items():
        exact = difference(moved)
        for one, wanted in zip(found, exact, strict=True):
            assert mine(one) == pytest.approx(wanted, rel=3e-5, abs=1e-9), (name, one)


@pytest.mark.parametrize(("sides", "height", "preload"), [
    pytest.param(*one, preload, marks=[pytest.mark.slow] * ((preload == 0) is (one[0] == 6)))
    for one in [(4, 0.7), (6, 0.9), (5, 0.2)] for preload in (0.0, 0.0002)
])  # fmt: skip
def test_prisms_of_any_sides_are_differentiated_by_their_arguments(sides, height, preload):
    """Beside triangles in one chain; the last one is flat before its bars meet."""
    asked, size = o.displacement(2), 1e-6

    def value(**changed):
        given = {"base": 1.0, "height": height, "prestrain": 0.05, "k_cross": 1.0} | changed
        other = Prism(**given, sides=sides).potential(preload)
        triangle = Prism(1.0, 0.7, 0.02, 1.0).potential(preload)
        chain = Chain([triangle, other, triangle], 4, ends=("free", "fixed"))
        return gradient(asked, chain, chain.at_rest({0: 0.02}), 10.0, dt=0.1, method="rkn6")

    found = value()
    for name, at in (("prestrain", 0.05), ("height", height), ("k_cross", 1.0)):
        above, below = (value(**{name: at + h}).value for h in (size, -size))
        wanted = (above - below) / (2 * size)
        assert found.by(name)[1] == pytest.approx(wanted, rel=3e-5, abs=1e-9), name


def test_masses_and_stiffnesses_in_proportion_change_nothing():
    """u and v depend on k/m only: sum k dJ/dk + sum m dJ/dm = 0."""
    chain = Chain(
        [PowerLaw(k, 1.5, 0.1) for k in (1.0, 1.3, 0.8, 1.1)], 5, [1.0, 2.0, 0.5, 1.5, 1.0]
    )
    asked = [o.displacement(3), o.p_norm(o.velocity(2), 8), o.arrival(3, 1e-2)]
    for one in gradient(asked, chain, chain.at_rest({0: 0.2}), 12.0, dt=0.05, method="rkn6"):
        # with the stiffness the preload grows in proportion: the overlap at rest stays
        by_k = np.array([k.values[0] for k in chain.springs]) @ one.by("stiffness")
        by_k += 0.1 * one.by("preload").sum()
        by_m = chain.mass @ one.mass
        assert abs(by_k + by_m) < 1e-12 * np.abs(chain.mass * one.mass).sum()
        assert abs(by_k) > 1e-6


def test_bonds_of_one_spring_sum_to_its_own_derivative():
    def chain(k):
        return Chain(Potential(ENERGY, R, {"k": k, "a": -0.5}), 8, ends=("fixed", "free"))

    asked, more = o.peak(o.load(wall=0)), {"t_end": 9.0, "dt": 0.05, "method": "rkn6"}
    state = chain(1.0).at_rest({7: 0.3})
    found = gradient(asked, chain(1.0), state, **more)
    h = 1e-6
    low, high = (gradient(asked, chain(1 + x), state, **more).value for x in (-h, h))
    assert found.by("k").shape == (7,)
    assert found.by("k").sum() == pytest.approx((high - low) / (2 * h), rel=1e-7)


def test_the_run_is_that_of_simulate_to_the_bit():
    chain = prisms()
    state = chain.at_rest({0: 0.05})
    found = gradient(o.peak(o.load(bond=3)), chain, state, 10.0, dt=0.03, method="rkn6")
    run_of = simulate(chain, state, 10.0, dt=0.03, method="rkn6")
    assert np.array_equal(found.run.final.u, run_of.final.u)
    assert np.array_equal(found.run.final.v, run_of.final.v)
    assert found.run.steps == run_of.steps
    assert found.run.scene is chain


def test_a_list_of_objectives_gives_what_each_gives_alone():
    chain, asked = prisms(), [o.displacement(3), o.peak(o.load(bond=3)), o.velocity(0)]
    run_of = chain, chain.at_rest({0: 0.05}), 10.0
    for one, together in zip(asked, gradient(asked, *run_of, **STEPS), strict=True):
        alone = gradient(one, *run_of, **STEPS)
        assert alone.value == together.value
        assert np.allclose(alone.u, together.u, rtol=1e-12, atol=0)
        assert np.allclose(alone.by("prestrain"), together.by("prestrain"), rtol=1e-12, atol=0)


def test_wanted_limits_what_by_knows_and_changes_nothing_else():
    chain = prisms()
    run_of = chain, chain.at_rest({0: 0.05}), 10.0
    every, some = (
        gradient(o.peak(o.load(bond=3)), *run_of, **STEPS, wanted=w) for w in (None, ("k_cross",))
    )
    assert np.allclose(every.by("k_cross"), some.by("k_cross"), rtol=1e-11, atol=0)
    assert np.allclose(every.v, some.v, rtol=1e-11, atol=0)
    named = gradient(o.peak(o.load(bond=3)), *run_of, **STEPS, wanted=("s_N",))
    assert np.allclose(named.parameters["s_N"], every.parameters["s_N"], rtol=1e-11, atol=0)
    assert set(named.parameters) == {"s_N"}


@pytest.mark.parametrize("method", METHODS)
def test_a_chain_turned_end_for_end_has_its_gradients_turned(method):
    """Also where packs of bonds go on behind the free end."""
    chain = prisms(ends=("free", "free"))
    turned = Chain(chain.springs[::-1], chain.sites, chain.mass[::-1])
    last, run_of = chain.sites - 1, {"t_end": 5.0, "dt": 0.1, "method": method}
    asked = [o.p_norm(o.load(bond=1), 4), o.peak(o.load(bond=3)), o.energy([0, 1])]
    other = [o.p_norm(o.load(bond=2), 4), o.peak(o.load(bond=0)), o.energy([last, last - 1])]
    ones = gradient(asked, chain, chain.at_rest({0: 0.05}), **run_of)
    others = gradient(other, turned, turned.at_rest({last: -0.05}), **run_of)
    for one, two in zip(ones, others, strict=True):
        for x, y in (
            (one.u, -two.u),
            (one.mass, two.mass),
            (one.by("height"), two.by("height")),
        ):
            assert np.abs(x - y[::-1]).max() < 1e-11 * np.abs(x).max()


def test_lanes_of_an_ensemble_are_chains_by_themselves():
    chains = [prisms((0.01 * k, 0.02, 0.05, 0.03)) for k in (1, 2, 3)]
    lanes = Ensemble(chains)
    asked, more = o.peak(o.load(bond=3)), {"t_end": 10.0, **STEPS}
    found = gradient(asked, lanes, lanes.at_rest({0: [0.05, 0.04, 0.03]}), **more)
    for k, chain in enumerate(chains):
        alone = gradient(asked, chain, chain.at_rest({0: (0.05, 0.04, 0.03)[k]}), **more)
        assert found.value[k] == alone.value
        assert np.array_equal(found.v[:, k], alone.v)
        assert np.array_equal(found.by("prestrain")[:, k], alone.by("prestrain"))


# back to the start


def chaotic(sites=10):
    """Beads between two walls, pushed hard."""
    chain = Chain(PowerLaw(1.0, 1.5), sites, ends=("fixed", "fixed"))
    return chain, chain.at_rest({1: 1.0, 4: -0.6})


def test_where_the_way_back_strays_more_states_are_given():
    chain, state = chaotic()
    run_of = chain, state, 200.0
    found = gradient(o.displacement(5), *run_of, dt=0.05)
    careful = gradient(o.displacement(5), *run_of, dt=0.05, checkpoints=1)
    assert found.reversal < 1e-9 * 2
    assert np.abs(found.v - careful.v).max() < 1e-6 * np.abs(careful.v).max()


def test_digits_tell_how_chaos_eats_them():
    chain, state = chaotic()
    left = [
        gradient(o.displacement(5), chain, state, t, dt=0.05).digits for t in (5.0, 100.0, 400.0)
    ]
    assert left[0] > 13
    assert left[0] > left[1] > left[2]
    assert left[2] < 8


def test_memory_does_not_grow_with_the_steps():
    chain = prisms()
    state = chain.at_rest({0: 0.05})

    def most(t_end):
        tracemalloc.start()
        gradient(o.displacement(3), chain, state, t_end, dt=0.05, wanted=("prestrain",))
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return peak

    most(10.0)
    assert most(800.0) < 1.2 * most(100.0) + 20_000


def test_a_run_of_no_time_has_the_gradient_of_its_start():
    chain = prisms()
    found = gradient([o.velocity(0), o.load(bond=1)], chain, chain.at_rest({0: 0.05}), 0.0, dt=0.1)
    assert found[0].value == 0.05
    assert np.array_equal(found[0].v, np.eye(5)[0])
    k = float(chain.springs[1].stiffness(0.0))
    assert np.allclose(found[1].u[:4], k * np.array([0, 1, -1, 0]), rtol=1e-12)
