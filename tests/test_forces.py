"""Forces of one's own on sites and in bonds: against SciPy, closed forms, and their own work."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from tensegrity import (
    METHODS,
    Chain,
    Damping,
    Drive,
    Ensemble,
    Force,
    Network,
    Potential,
    PowerLaw,
    Prism,
    Record,
    Run,
    StabilityError,
    State,
    TensegrityError,
    bond_force,
    budget,
    modes,
    resume,
    simulate,
)

T, U, V, C, R, RATE = sp.symbols("t u v c r rate")
SPRING = Prism(1.0, 0.7, 0.01, 1.0).potential()
SITES, END = 8, 6.0
MASS = np.linspace(1, 2, SITES)
DRAG = np.linspace(0.1, 0.3, SITES)
STRUT = [0, 2, 3, 5]


def scene(**more):
    """A driven chain with nonlinear forces of all kinds."""
    on_sites = Force(
        -C * V * sp.sqrt(V**2 + sp.Rational(1, 100)) + sp.sin(T) * U / 10 + sp.cos(T) / 100,
        parameters={"c": DRAG},
    )
    in_bonds = Force(C * RATE * (1 + R**2) + R**3 / 5, "bonds", STRUT, {"c": 0.2})
    drive = {
        SITES - 1: Drive(displacement=sp.sin(T) ** 2 / 50),
        3: Drive(force=sp.sin(2 * T) / 30),
    }
    given = {"drive": drive, "damping": Damping(bond=0.05, ground=0.02)} | more
    return Chain(SPRING, SITES, MASS, forces=(on_sites, in_bonds), **given)


def rates(t, y):
    """The equations of motion of `scene`, written out."""
    u, v = y[:SITES].copy(), y[SITES:].copy()
    u[-1], v[-1] = np.sin(t) ** 2 / 50, np.sin(2 * t) / 50
    r, rate = np.diff(u), np.diff(v)
    tension = SPRING.tension(r) + 0.05 * rate
    tension[STRUT] += 0.2 * rate[STRUT] * (1 + r[STRUT] ** 2) + r[STRUT] ** 3 / 5
    force = np.zeros(SITES)
    force[:-1] += tension
    force[1:] -= tension
    force += -DRAG * v * np.sqrt(v**2 + 0.01) + np.sin(t) * u / 10 + np.cos(t) / 100 - 0.02 * v
    force[3] += np.sin(2 * t) / 30
    force[-1] = v[-1] = 0
    return np.concatenate([v, force / MASS])


@pytest.fixture(scope="module")
def reference():
    state = scene().at_rest({0: 0.1})
    start = np.concatenate([state.u, state.v])
    return solve_ivp(rates, (0, END), start, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]


def errors(run, reference):
    wrong = [run.final.u[:-1] - reference[: SITES - 1], run.final.v[:-1] - reference[SITES:-1]]
    energy = run.energy - run.energy[0] - (run.work - run.work[0]) + (run.loss - run.loss[0])
    return np.abs(wrong).max(), np.abs(energy).max()


@pytest.mark.parametrize(
    "tol", [1e-3, 1e-9, *(pytest.param(x, marks=pytest.mark.slow) for x in (1e-6, 1e-11))]
)
def test_all_forces_together_meet_a_tolerance(reference, tol):
    run = simulate(scene(), scene().at_rest({0: 0.1}), END, tol=tol)
    wrong, energy = errors(run, reference)
    assert run.method == "rk8"
    assert wrong <= tol * 0.1  # of the speed of the blow
    assert energy <= tol * run.energy[0]
    assert run.loss[-1] > 0.5 * run.energy[0]


@pytest.mark.parametrize(("method", "steps", "order"), [("rk4", 60, 3.7), ("rk8", 10, 7.3)])
def test_the_order_is_that_of_the_method(reference, method, steps, order):
    counts, found = [steps, 2 * steps, 3 * steps, 4 * steps, 6 * steps], []
    for count in counts:
        dt = END / count
        run = simulate(scene(), scene().at_rest({0: 0.1}), END, dt=dt, method=method)
        found.append(errors(run, reference))
    for wrong in np.transpose(found):
        assert -np.polyfit(np.log(counts), np.log(wrong), 1)[0] > order


def test_dashpots_are_forces():
    damping = Damping(bond=np.linspace(0.1, 0.4, SITES - 1), ground=0.2)
    idle = Force(0 * V + T - T + C * U, parameters={"c": 0.0})
    state = Chain(SPRING, SITES, MASS).at_rest({0: 0.1})
    both = [
        simulate(Chain(SPRING, SITES, MASS, damping=damping, **more), state, END, tol=1e-11)
        for more in ({}, {"forces": (idle,)})
    ]
    assert [run.method for run in both] == ["rkn6", "rk8"]
    np.testing.assert_allclose(both[0].final.u, both[1].final.u, rtol=0, atol=1e-12)
    assert both[0].loss[-1] == pytest.approx(both[1].loss[-1], abs=1e-12)


def test_quadratic_drag_has_its_closed_form():
    drag = Force(-C * abs(V) * V, parameters={"c": [0.5, 1.0]})
    chain = Chain(PowerLaw(1.0, 1.5), sites=2, mass=[1.0, 2.0], forces=(drag,))
    run = simulate(chain, chain.at_rest({0: 1.0, 1: 1.0}), 4.0, tol=1e-10)
    np.testing.assert_allclose(run.v, 1 / (1 + 0.5 * run.t)[:, None] * [1, 1], rtol=0, atol=1e-10)
    assert run.loss[-1] == pytest.approx(1.5 * (1 - 1 / 9), abs=1e-9)


def test_the_speed_has_the_kink_of_an_absolute_value():
    """Quadratic drag of sites that turn back, in both spellings."""
    runs = []
    for speed in (abs(V), sp.Symbol("speed")):
        drag = Force(-C * speed * V, parameters={"c": 0.4})
        chain = Chain(PowerLaw(1.0, 2.0), 6, ends=("free", "fixed"), forces=(drag,))
        runs.append(simulate(chain, chain.at_rest({0: 0.5, 3: -0.3}), END, tol=1e-8))
    assert runs[1].steps == runs[0].steps
    assert Force(-(sp.Symbol("speed") ** 2) * V).law.continuity == np.inf  # a polynomial


PIECES = {  # exponents at the places where pieces meet
    "a kink": (sp.Piecewise((V / 5, V < 0), (V, True)), 1),
    "a ramp": (C * sp.Piecewise((-1, V < -1), (V, V < 1), (1, True)), 1),
    "a relative kink": (sp.Piecewise((V, V < U), (2 * V - U, True)), 1),
    "round-off at 0": (sp.Piecewise((0.7 * V - 7e-18, V < 0), (V, V < 1), (1, True)), 1),
    "rounded lines": (
        sp.Piecewise(
            (1.4 * V + 0.21, V < -0.1),
            (0.07 - 0.11 * (V / 0.6 + 1 / 6), V < 0.5),
            ((V - 0.5) / 3 - 0.04, True),
        ),
        1,
    ),
    "a small jump": (sp.Piecewise((0.7 * V - 7e-10, V < 0), (V, V < 1), (1, True)), 0),
    "a jump": (sp.Piecewise((0, V < 0), (1, True)), 0),
    "a jump beyond a kink": (sp.Piecewise((0, V < 0), (V, V < 1), (2, True)), 0),
    "an infinite slope": (sp.Piecewise((0, V < 0), (sp.sqrt(V), True)), 0),
    "undefined": (sp.Piecewise((V, V < 0)), 0),
}


@pytest.mark.parametrize(("expression", "exponent"), PIECES.values(), ids=PIECES)
def test_pieces_that_agree_where_they_meet_have_kinks(expression, exponent):
    given = {"c": 1.0} if expression.has(C) else {}
    assert Force(-expression, parameters=given).law.continuity == exponent


def test_both_spellings_of_a_one_sided_dashpot_take_the_same_steps():
    runs = []
    for rate in (sp.Piecewise((RATE / 5, RATE < 0), (RATE, True)), sp.Max(RATE / 5, RATE)):
        strut = Force(C * rate, "bonds", parameters={"c": 0.2})
        chain = Chain(PowerLaw(1.0, 2.0), 6, ends=("free", "fixed"), forces=(strut,))
        runs.append(simulate(chain, chain.at_rest({0: 0.5, 3: -0.3}), END, tol=1e-7))
    assert runs[0].steps == runs[1].steps
    np.testing.assert_array_equal(runs[0].u, runs[1].u)


@pytest.mark.filterwarnings("error:a trial run")
def test_a_long_run_at_a_kink_is_announced():
    dry = Force(-C * sp.sign(V), parameters={"c": 1e-3})
    chain = Chain(SPRING, SITES, MASS, forces=(dry,))
    words = "a trial run of [0-9]+ steps follows: .* limit rk8 to order 1, and tol is 1e-10"

    with pytest.raises(RuntimeWarning, match=words):
        simulate(chain, chain.at_rest({0: 0.1}), END, tol=1e-10)


def test_forces_in_bonds_keep_the_momentum():
    strut = Force(C * RATE**3 + R**2 * RATE, "bonds", parameters={"c": 2.0})
    chain = Chain(SPRING, SITES, MASS, forces=(strut,))
    run = simulate(chain, chain.at_rest({0: 0.05}), 20.0, tol=1e-8)
    assert run.v @ MASS == pytest.approx(0.05, abs=1e-14)
    assert np.all(np.diff(run.loss) > -1e-10)  # the force is passive


def test_forces_of_time_and_dashpots_are_drives_and_damping():
    """To the bit, with the same method, in chains and networks; others need another method."""
    pull = sp.sin(T) / 100
    named = {"damping": Damping(ground=0.1, bond=0.2), "drive": {2: Drive(force=pull)}}
    drag, strut = Force(-C * V, parameters={"c": 0.1}), Force(RATE / 5, "bonds")
    chains = Chain(SPRING, 6, **named), Chain(SPRING, 6, forces=(drag, strut, Force(pull, at=[2])))
    at, v = [(k, 0.1 * k**2) for k in range(4)], sp.symbols("v_x v_y")
    named["drive"] = {2: Drive(force=(pull, None))}
    forces = (Force([-x / 10 for x in v]), strut, Force((pull, 0.0), at=[2]))
    row = at, [(0, 1), (1, 2), (2, 3)], SPRING
    nets = Network(*row, **named), Network(*row, forces=forces)
    for pair, start in ((chains, {0: 0.02}), (nets, {0: (0.02, 0.01)})):
        one, other = (simulate(x, x.at_rest(start), 5.0, tol=1e-7) for x in pair)
        assert one.method == other.method == "rkn6"
        for name in ("u", "work", "loss"):
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name))
        assert one.loss[-1] > 1e-6
    for force in (Force(C * V, parameters={"c": 0.1}), Force(-C * V * T, parameters={"c": 0.1})):
        chain = Chain(SPRING, 6, forces=(force,))
        assert simulate(chain, chain.at_rest({0: 0.02}), 1.0).method == "rk8"


def test_a_step_beyond_the_decay_is_refused():
    chain = Chain(SPRING, SITES, MASS, forces=(Force(-C * V, parameters={"c": 100.0}),))
    state = chain.at_rest({0: 0.1})
    assert 1 / 36 < METHODS["rk4"].decay_limit / 100 < 1 / 35
    with pytest.raises(StabilityError, match="the limit of rk4 for the rate"):
        simulate(chain, state, 1.0, dt=1 / 35, method="rk4")
    assert simulate(chain, state, 1.0, dt=1 / 36, method="rk4").complete
    assert simulate(chain, state, 1.0, tol=1e-6).complete
    harder = Chain(SPRING, SITES, MASS, forces=(Force(-C * V * T, parameters={"c": 100.0}),))
    with pytest.raises(StabilityError, match="the limit of rk4 for the rate"):
        simulate(harder, state, 4.0, dt=0.01)


def test_a_force_that_becomes_nan_is_named_besides_the_step():
    chain = Chain(SPRING, SITES, MASS, forces=(Force(C * sp.sqrt(U), parameters={"c": 1.0}),))
    with pytest.raises(StabilityError, match=r"no longer finite at .*, or a force not finite"):
        simulate(chain, chain.at_rest({0: -0.1}), 1.0, dt=0.01)


def test_runs_are_stored_read_and_resumed(tmp_path):
    state, path = scene().at_rest({0: 0.1}), tmp_path / "stored.npz"
    run = simulate(scene(), state, END, dt=0.01)
    run.save(path)
    np.testing.assert_array_equal(Run.load(path).loss, run.loss)
    record = Record(every=1, path=tmp_path / "rows.npy", checkpoint=0.0)

    def stop(t, *_):
        if t > END / 2:
            raise KeyboardInterrupt

    simulate(scene(), state, END, dt=0.01, record=record, observe=stop)
    ended = resume(tmp_path / "rows.npy", scene())
    np.testing.assert_array_equal(ended.final.u, run.final.u)
    assert ended.loss[-1] == run.loss[-1]


def test_a_batch_takes_them():
    scenes = [scene(), Chain(SPRING, SITES, MASS, forces=(Force(-V),))]
    batch = Ensemble(scenes)
    starts = [one.at_rest({0: 0.1}) for one in scenes]
    start = State(*(np.stack([getattr(x, k) for x in starts], axis=-1) for k in "uv"))
    run = simulate(batch, start, END, dt=0.02)
    for number, one in enumerate(scenes):
        alone = simulate(one, starts[number], END, dt=0.02, method=run.method)
        np.testing.assert_array_equal(run.final.u[:, number], alone.final.u)


@pytest.mark.parametrize(
    ("words", "make"),
    [
        ("contains w: on sites it may contain t, u, v", lambda: Force(sp.Symbol("w") * V)),
        ("contains v: on bonds it may contain t, r, rate", lambda: Force(V, "bonds")),
        ("does not contain c", lambda: Force(V, parameters={"c": 1.0})),
        ("parameter u of a force is one of", lambda: Force(U, parameters={"u": 1.0})),
        ("must be finite", lambda: Force(C * V, parameters={"c": np.nan})),
        ("no SymPy expression", lambda: Force("v")),
        ("acts on 'roof'", lambda: Force(V, "roof")),
        ("must differ, and exist", lambda: Force(V, at=[1, 1])),
        ("is -inf at t = 0 s", lambda: Force(V / T)),
        ("is nan at t = 0 s", lambda: Force(sp.sqrt(V))),
        ("there are 3", lambda: Chain(SPRING, 3, forces=[Force(V, at=[3])])),
        ("there are 2", lambda: Chain(SPRING, 3, forces=[Force(R, "bonds", [2])])),
        ("forces", lambda: Chain(SPRING, 3, forces=Force(V))),
        (
            "2 values for 3 sites",
            lambda: Chain(SPRING, 3, forces=[Force(C * V, parameters={"c": [1, 2]})]),
        ),
        (
            "springs that change exclude forces but",
            lambda: Chain(SPRING.over_time(prestrain=0.01 + T), 3, forces=[Force(U)]),
        ),
    ],
)
def test_wrong_forces_are_refused(words, make):
    with pytest.raises(TensegrityError, match=words):
        make()


def test_the_budget_of_a_part_of_a_chain_counts_them():
    """Drag, losses in bonds, dashpots and springs to the ground, on either side of a bond."""
    r, rate, c = sp.symbols("r rate c")
    loss = Force(c * rate * (1 + r**2), "bonds", parameters={"c": 0.1})
    drag = Force(-c * V**3, parameters={"c": 20.0})
    held = Force(Potential(sp.Symbol("u") ** 2 / 5, sp.Symbol("u")), at=[2, 5])
    chain = Chain(SPRING, SITES, MASS, forces=(loss, drag, held), damping=Damping(0.03, 0.02))
    run = simulate(chain, chain.at_rest({0: 0.1, 3: -0.1, 6: 0.1}), END, dt=0.005, method="rk8")
    for bond in (0, 3, SITES - 2):
        found = budget(run, bond)
        assert found.energy_error < 1e-9
        assert found.momentum_error < 1e-9
        assert np.abs(found.work).max() > 1e-3 * run.energy[0]


def test_the_force_of_a_bond_is_that_of_spring_dashpot_and_forces():
    """As in `rates`; in a network along the bond, which turns, by what its last site gains."""
    one = scene()
    run = simulate(one, one.at_rest({1: 0.1}), END, dt=0.01, method="rk8", record=Record(every=9))
    r, rate = np.diff(run.u, axis=1), np.diff(run.v, axis=1)
    wanted = SPRING.tension(r) + 0.05 * rate
    wanted[:, STRUT] += 0.2 * rate[:, STRUT] * (1 + r[:, STRUT] ** 2) + r[:, STRUT] ** 3 / 5
    np.testing.assert_allclose(bond_force(run), wanted, rtol=1e-12, atol=1e-14)
    assert np.abs(wanted - one.bond_tension(run.u)).max() > 1e-3

    loss = Force(C * RATE + R**3 / 5, "bonds", [1], {"c": 0.2})
    net = Network([(0, 0), (1, 0), (1.5, 1)], [(0, 1), (1, 2)], SPRING, forces=(loss,),
                  damping=Damping(bond=0.05))  # fmt: skip
    run = simulate(net, net.at_rest({2: (0.1, 0.2)}), 2.0, dt=0.01, method="rk8",
                   record=Record(every=1))  # fmt: skip
    away = net.positions[2] + run.u[:, 2] - net.positions[1] - run.u[:, 1]
    away /= np.linalg.norm(away, axis=1)[:, None]
    gained = net.mass[2] * make_interp_spline(run.t, run.v[:, 2], k=7).derivative()(run.t)
    np.testing.assert_allclose(-bond_force(run)[:, 1:] * away, gained, atol=1e-9)
    assert np.ptp(away[:, 0]) > 1e-2
    many = Ensemble(Chain(SPRING, 3), 2)
    run = simulate(many, many.at_rest({0: 0.1}), 1.0, dt=0.1)
    with pytest.raises(TensegrityError, match="of the run is Ensemble, not a Chain or a Network"):
        bond_force(run)


def test_what_knows_no_such_forces_refuses_them():
    chain = Chain(SPRING, SITES, forces=(Force(-V * abs(V)),))
    state = chain.at_rest({0: 0.1})
    for call in (
        lambda: modes(chain),
        lambda: simulate(chain, state, 1.0, dt=0.01, method="verlet"),
        lambda: simulate(chain, state, 1.0, dt=0.01, method="midpoint"),
    ):
        with pytest.raises(TensegrityError):
            call()
