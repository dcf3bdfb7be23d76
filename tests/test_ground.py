"""Springs between sites and the ground: energy, motion, modes and waves against other methods."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from tensegrity import (
    Chain,
    Damping,
    Ensemble,
    EquilibriumError,
    Force,
    LockingError,
    Network,
    Potential,
    Prism,
    Run,
    StabilityError,
    State,
    TensegrityError,
    catalogue,
    dispersion,
    gradient,
    modes,
    periodic_orbit,
    simulate,
)
from tensegrity.objective import energy, load, peak

U, A, B = sp.symbols("u a b")
SITES, END = 9, 8.0
MASS = np.linspace(1, 2, SITES)
SPRING = Prism(1.0, 0.7, 0.1, 1.0).potential()
TWO_WELLS = Potential(B * U**2 * (3 * U**2 - 4 * (1 + A) * U + 6 * A) / 12, U, {"a": 0.3, "b": 1})
PULLED = Potential((U**2 + 1) ** sp.Rational(1, 2) + U / 5, U)


WELL = np.linspace(0.2, 0.4, SITES)


def ground():
    """Springs of two laws, one of them with other values at each site."""
    return [TWO_WELLS.varied({"a": a}) if k % 3 else PULLED for k, a in enumerate(WELL)]


def chain(**more):
    return Chain(SPRING, SITES, MASS, ground=ground(), **more)


def rates(t, y, dashpot=0.0):
    u, v = y[:SITES], y[SITES:]
    force = np.diff(SPRING.tension(np.diff(u)), prepend=0.0, append=0.0)
    pull = u * (u - 1) * (u - WELL)
    pull[::3] = u[::3] / np.sqrt(u[::3] ** 2 + 1) + 0.2
    force -= pull
    return np.concatenate([v, (force - dashpot * v) / MASS])


@pytest.mark.parametrize("dashpot", [0.0, 0.1])
def test_motion_is_that_of_the_written_equations(dashpot):
    scene = chain(damping=Damping(ground=dashpot) if dashpot else None)
    state = scene.at_rest({0: 0.05, 4: -0.05})
    start = np.concatenate([state.u, state.v])
    exact = solve_ivp(rates, (0, END), start, "DOP853", rtol=1e-12, atol=1e-14, args=(dashpot,))
    run = simulate(scene, state, END, tol=1e-10)
    np.testing.assert_allclose(run.final.u, exact.y[:SITES, -1], rtol=0, atol=1e-11)
    np.testing.assert_allclose(run.final.v, exact.y[SITES:, -1], rtol=0, atol=1e-11)
    assert not run.work.any()  # what the ground takes is energy of the chain
    lost = run.energy - run.energy[0] + run.loss
    assert np.abs(lost).max() < 1e-11
    assert (run.loss[-1] > 1e-4) == bool(dashpot)


def test_the_energy_is_that_of_all_springs():
    u, v = np.linspace(-0.05, 0.03, SITES), np.linspace(0.1, 0.2, SITES)
    found = SPRING.energy(np.diff(u)).sum() + MASS @ v**2 / 2
    found += sum(float(one.energy(x)) for one, x in zip(ground(), u, strict=True))
    scene, state = chain(), State(u, v)
    assert scene.energy(state) == pytest.approx(found, rel=1e-14)
    assert scene.site_energy(state).sum() == pytest.approx(found, rel=1e-14)
    np.testing.assert_allclose(scene.forces(u) / MASS, rates(0, np.append(u, v))[SITES:], 1e-13)
    step = 1e-6
    other = (scene.forces(u + step) - scene.forces(u - step)) / (2 * step)
    np.testing.assert_allclose(-scene.stiffness(u) @ np.ones(SITES), other, rtol=0, atol=1e-9)


def test_a_fixed_site_is_not_pulled_by_the_ground():
    scene = Chain(SPRING, 3, ground=PULLED, ends=("fixed", "free"))
    assert scene.forces(np.zeros(3))[0] == 0
    assert scene.stiffness(np.zeros(3)).toarray()[0].tolist() == [0, 0, 0]


def test_modes_are_raised_by_the_ground():
    linear, held = Potential(U**2 / 2, U), Potential(3 * U**2 / 2, U)
    row = Chain(linear, 8, ends=("fixed", "fixed"), ground=held)
    exact = np.sqrt(3 + 4 * np.sin(np.arange(1, 7) * np.pi / 14) ** 2)
    np.testing.assert_allclose(modes(row).frequencies, exact, rtol=1e-12)
    row = Chain(linear, 8, ground=TWO_WELLS)  # V'' = a b in one well, (1 - a) b in the other
    still = State(np.ones(8), np.zeros(8))
    for about, square in ((None, 0.3), (still, 0.7)):
        assert modes(row, about).frequencies[0] == pytest.approx(np.sqrt(square), rel=1e-12)
    with pytest.raises(EquilibriumError, match="unbalanced force"):
        modes(Chain(linear, 8, ground=PULLED))
    with pytest.raises(EquilibriumError, match="unstable"):
        modes(row, State(np.full(8, 0.3), np.zeros(8)))


def test_dispersion_begins_at_the_frequency_of_the_ground():
    q, linear, held = np.linspace(0, np.pi, 5), Potential(U**2 / 2, U), Potential(U**2 / 4, U)
    found = dispersion(linear, 2.0, q, ground=held)[:, 0]
    np.testing.assert_allclose(found, np.sqrt((0.5 + 4 * np.sin(q / 2) ** 2) / 2), rtol=1e-14)
    found = dispersion(linear, [1.0, 2.0], q, ground=[held, linear])
    for phase, two in zip(q, found, strict=True):
        across = 1 + np.exp(1j * phase)
        matrix = np.array([[2.5, -across.conj()], [-across, 3.0]]) / np.sqrt([[1, 2], [2, 4]])
        np.testing.assert_allclose(two**2, np.linalg.eigvalsh(matrix), rtol=1e-13)
    with pytest.raises(TensegrityError, match="spring 0 at rest must be at least 0"):
        dispersion(linear, 1.0, q, ground=Potential(-(U**2), U))
    with pytest.raises(TensegrityError, match="2 springs to the ground and 3 masses"):
        dispersion(linear, [1.0] * 3, q, ground=[held] * 2)


def test_the_ground_is_a_force_of_a_potential(tmp_path):
    state = chain().at_rest({0: 0.05})
    every = Force(TWO_WELLS, at=[2, 5], parameters={"a": [0.2, 0.4]})
    mixed = Chain(SPRING, SITES, MASS, forces=(every,))
    only = [Potential(sp.Integer(0), U)] * SITES
    only[2], only[5] = (TWO_WELLS.varied({"a": a}) for a in (0.2, 0.4))
    same = Chain(SPRING, SITES, MASS, ground=only)
    runs = [simulate(one, state, END, dt=0.02) for one in (mixed, same)]
    np.testing.assert_allclose(runs[0].final.u, runs[1].final.u, rtol=0, atol=1e-15)
    other = Prism(1.0, 0.7, 0.2, 1.0).potential()
    prisms = Chain(SPRING, SITES, MASS, ground=[SPRING, other] * 4 + [SPRING])
    run = simulate(prisms, state, END, dt=0.02)
    run.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz").scene
    assert again.energy(run.final) == prisms.energy(run.final) == run.energy[-1]
    run = simulate(chain(), state, END, dt=0.02)
    both = simulate(Ensemble([chain(), mixed]), State(*(np.stack([x] * 2, -1) for x in
                    (state.u, state.v))), END, dt=0.02)  # fmt: skip
    np.testing.assert_array_equal(both.final.u[:, 0], run.final.u)
    np.testing.assert_array_equal(both.energy[:, 0], run.energy)


def test_a_step_that_a_stiff_ground_does_not_allow_is_refused():
    soft, stiff = Potential(U**2 / 200, U), Potential(5000 * U**2, U)
    scene = Chain(soft, 3, ground=stiff)
    state = scene.at_rest({0: 0.1})
    assert simulate(scene, state, 1.0, dt=0.01, method="rk4").complete
    with pytest.raises(StabilityError):
        simulate(scene, state, 1.0, dt=0.03, method="rk4")  # rk4 is stable up to 0.0283 s
    hard = Chain(soft, 3, ground=Potential(2500 * U**4, U))  # stiff far from rest only
    with pytest.raises(StabilityError, match="at which forces change velocities"):
        simulate(hard, State(np.ones(3), np.zeros(3)), 1.0, dt=0.02, method="rk4")
    assert simulate(hard, hard.at_rest({0: 0.1}), 1.0, dt=0.02, method="rk4").complete


LOAD = peak(load(bond=1))
ELASTIC = Prism(1.0, 0.7, 0.1, 1.0, k_base=10.0, k_bar=100.0).potential()


@pytest.mark.parametrize(
    ("words", "make"),
    [
        ("2 springs to the ground for 3 sites", lambda: Chain(SPRING, 3, ground=[PULLED] * 2)),
        ("ground", lambda: Chain(SPRING, 3, ground=3.0)),
        ("spring to the ground of site 1", lambda: Chain(SPRING, 2, ground=[PULLED, 1.0])),
        ("holds no site to the ground", lambda: Chain(SPRING, 3, ground=ELASTIC)),
        ("parameter c of it does not exist", lambda: Force(TWO_WELLS, parameters={"c": 1.0})),
        ("on other places", lambda: Force(TWO_WELLS, on="bonds")),
        ("is at or above", lambda: Chain(SPRING, 2, ground=SPRING).energy(State([0, 1], [0, 0]))),
        (
            "1 expressions of a force on sites of a scene with 2",
            lambda: Network([(0, 0), (1, 0)], [(0, 1)], SPRING, forces=(Force(PULLED),)),
        ),
        (
            "leaves out springs to the ground",
            lambda: gradient(energy(), chain(), chain().at_rest(), 1, dt=0.1),
        ),
        ("at rest", lambda: periodic_orbit(chain(), chain().at_rest(), period=1.0)),
    ],
)
def test_what_the_ground_cannot_be_is_refused(words, make):
    with pytest.raises(TensegrityError, match=words):
        make()


def test_a_site_that_reaches_the_end_of_its_spring_to_the_ground_is_named():
    unit = catalogue.twin_strings(prestrain=0.1)  # its bars meet at a twist of 2 pi/3
    chain = Chain(Potential(U**2 / 2000, U), sites=2, ground=unit)
    start = State(np.zeros(2), np.ones(2))
    with pytest.raises(LockingError, match=r"2\.0944 m.*ground got there at t = 2\.") as found:
        simulate(chain, start, t_end=6.0, tol=1e-8)
    assert found.value.run.u.max() < 2 * math.pi / 3
    near = simulate(chain, State(np.zeros(2), 0.1 * np.ones(2)), t_end=6.0, tol=1e-8)
    assert near.energy_error < 1e-7


def test_a_network_on_a_line_has_the_springs_to_the_ground_of_a_chain():
    """Forces, energies and motion are those of the chain, although it has other arrays."""
    well, at = Potential(B * U**2 / 2 + U**4, U, {"b": 0.5}), [0, 2]
    chain = Chain(SPRING, 4, forces=[Force(well, at=at)])
    pairs = [(0, 1), (1, 2), (2, 3)]
    line = Network([[k] for k in range(4)], pairs, SPRING, forces=[Force(well, at=at)])
    state = State([0.02, 0.0, -0.01, 0.03], [0.0, 0.1, 0.0, 0.0])
    other = State(state.u[:, None], state.v[:, None])
    np.testing.assert_array_equal(line.forces(other.u)[:, 0], chain.forces(state.u))
    np.testing.assert_array_equal(line.stiffness(other.u).data, chain.stiffness(state.u).data)
    np.testing.assert_allclose(line.site_energy(other), chain.site_energy(state), rtol=1e-14)
    assert line.energy(other) == chain.energy(state)
    assert line.energy(other) == pytest.approx(line.site_energy(other).sum())
    one, two = simulate(chain, state, 4.0, dt=0.01), simulate(line, other, 4.0, dt=0.01)
    np.testing.assert_allclose(two.u[..., 0], one.u, rtol=0, atol=1e-14)
    assert two.energy_error < 1e-7
