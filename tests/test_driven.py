"""Driven and damped scenes: closed forms, orders of the methods, balances of energy, errors."""

import cmath
import math

import numpy as np
import pytest
import sympy as sp
from networks import plate
from oracle import ORDERS
from scipy.integrate import solve_ivp
from springs import series

import granular
from tensegrity import (
    Chain,
    Damping,
    Drive,
    LockingError,
    Network,
    Potential,
    Prism,
    Record,
    Run,
    StabilityError,
    State,
    TensegrityError,
    angular_momentum,
    directions,
    modes,
    simulate,
)

T, R = sp.symbols("t r")
CUBIC = series(0, 1 / 4, length=1.0)
SHAKER = Drive(displacement=0.3 * sp.sin(1.3 * T))
PULL = Drive(force=0.1 * sp.cos(T))
SCENES = {
    "moved": {"drive": {0: SHAKER}},
    "pulled": {"drive": {3: PULL}},
    "to the ground": {"damping": Damping(ground=0.2)},
    "in bonds": {"damping": Damping(bond=np.linspace(0.3, 0, 7))},
    "moved, to the ground": {"drive": {0: SHAKER}, "damping": Damping(ground=0.1)},
    "all": {"drive": {0: SHAKER, 4: PULL}, "damping": Damping(bond=0.2, ground=0.1)},
}


def linear(stiffness):
    return series(k=stiffness, length=1.0)


def scene_of(name):
    return Chain(CUBIC, 8, np.linspace(1, 2, 8), ("free", "fixed"), **SCENES[name])


class Oscillator:
    """m x'' + g x' + k x = Re(f exp(i w t)), from x and x' at 0: the closed form."""

    def __init__(self, m, g, k, f, w, x, v):
        self._steady, self._w = f / (k - m * w**2 + 1j * g * w), w
        self._rate = (-g + cmath.sqrt(g**2 - 4 * m * k)) / (2 * m)
        x, v = x - self._steady.real, v - (1j * w * self._steady).real
        self._free = complex(x, (self._rate.real * x - v) / self._rate.imag)

    def __call__(self, t, order=0):
        parts = (self._free, self._rate), (self._steady, 1j * self._w)
        return sum((a * b**order * cmath.exp(b * t)).real for a, b in parts)


def order_of(steps, errors):
    return -np.polyfit(np.log(steps), np.log(errors), 1)[0]


@pytest.mark.parametrize("damping", [Damping(ground=0.3), Damping(bond=0.3)])
@pytest.mark.parametrize("method", ["verlet", "rkn6"])
def test_methods_keep_their_order_on_a_driven_and_damped_oscillator(method, damping):
    exact = Oscillator(0.7, 0.3, 2.0, 0.5, 1.1, 0.0, 0.4)
    drive = {1: Drive(force=0.5 * sp.cos(1.1 * T))}
    chain = Chain(linear(2.0), 2, 0.7, ("fixed", "free"), drive=drive, damping=damping)
    steps, errors = np.array([10, 14, 20, 28]), []
    for count in steps:
        end = simulate(chain, chain.at_rest({1: 0.4}), 5.0, method=method, dt=5 / count).final
        errors.append(max(abs(end.u[1] - exact(5.0)), abs(end.v[1] - exact(5.0, 1))))
    assert order_of(steps, errors) == pytest.approx(ORDERS[method], abs=0.45)
    fine = simulate(chain, chain.at_rest({1: 0.4}), 5.0, method=method, dt=0.01).final
    assert abs(fine.u[1] - exact(5.0)) < {"verlet": 1e-4}.get(method, 1e-13)


def test_a_mass_on_a_shaken_base_follows_the_closed_form():
    """Moved site 0 pulls through a spring and a dashpot: f = a (k + i g w)."""
    a, w, g, k = 0.2, 1.7, 0.25, 1.5
    drive = {0: Drive(displacement=a * sp.sin(w * T))}
    chain = Chain(linear(k), 2, 1.0, drive=drive, damping=Damping(bond=g))
    exact = Oscillator(1.0, g, k, -1j * a * (k + 1j * g * w), w, 0.0, 0.0)
    run = simulate(chain, chain.at_rest(), 8.0, tol=1e-11)
    assert run.final.u[1] == pytest.approx(exact(8.0), abs=1e-11)
    np.testing.assert_allclose(run.u[:, 0], a * np.sin(w * run.t), atol=1e-16)
    np.testing.assert_allclose(run.v[:, 0], a * w * np.cos(w * run.t), atol=1e-15)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("method", ["rkn6", pytest.param("verlet", marks=pytest.mark.slow)])
def test_methods_keep_their_order_in_motion_work_and_loss(name, method):
    scene, order = scene_of(name), ORDERS[method]
    state = scene.at_rest({5: 0.3})
    fine = simulate(scene, state, 4.0, method="rkn6", dt=0.02)
    steps = np.array([16, 22, 32])
    runs = [simulate(scene, state, 4.0, method=method, dt=4 / n) for n in steps]
    errors = [max(np.abs(run.final.u - fine.final.u).max(),
                  np.abs(run.final.v - fine.final.v).max(), abs(run.work[-1] - fine.work[-1]),
                  abs(run.loss[-1] - fine.loss[-1])) for run in runs]  # fmt: skip
    assert order_of(steps, errors) > order - 0.5
    assert errors[-1] > 1e-13  # above round-off, where there is an order to see
    balance = [run.energy_error for run in runs]
    assert order_of(steps, balance) > order - 0.7
    assert fine.energy_error < 1e-10
    assert abs(fine.work[-1]) > 1e-3 or not scene.drive
    assert fine.loss[-1] > 1e-3 or scene.damping is None


def test_work_is_the_integral_of_the_force_of_the_driver_times_its_velocity():
    scene = scene_of("all")
    record = Record(every=1)
    run = simulate(scene, scene.at_rest({5: 0.3}), 4.0, method="rkn6", dt=0.02, record=record)
    r, rate = np.diff(run.u), np.diff(run.v)
    u, v = run.u[:, 0], run.v[:, 0]
    acceleration = -(1.3**2) * u
    pulled = r[:, 0] + r[:, 0] ** 3 + 0.2 * rate[:, 0] - 0.1 * v
    power = (scene.mass[0] * acceleration - pulled) * v + 0.1 * np.cos(run.t) * run.v[:, 4]
    loss = 0.2 * np.sum(rate**2, axis=1) + 0.1 * np.sum(run.v**2, axis=1)
    weights = np.full(201, 2.0) + 2 * (np.arange(201) % 2)
    weights[[0, -1]] = 1
    assert run.work[-1] == pytest.approx(np.dot(weights, power) * 0.02 / 3, abs=1e-8)
    assert run.loss[-1] == pytest.approx(np.dot(weights, loss) * 0.02 / 3, abs=1e-8)
    assert run.loss[0] == run.work[0] == 0


def test_dashpots_in_bonds_slow_a_mode_at_the_reference_rate():
    """g (1 - cos q)/m: the amplitude of wavenumber q decays so, half the energy's rate."""
    q, g = math.pi / 9 * 4, 0.05
    chain = Chain(linear(1.0), 10, 1.0, ("fixed", "fixed"), damping=Damping(bond=g))
    shape = np.sin(q * np.arange(10))
    shape[[0, -1]] = 0
    rate, square = g * (1 - math.cos(q)), 2 - 2 * math.cos(q)
    t = 6 * math.pi / math.sqrt(square - rate**2)
    run = simulate(chain, State(shape, -rate * shape), t, tol=1e-11)
    np.testing.assert_allclose(run.final.u, math.exp(-rate * t) * shape, atol=1e-11)


def test_energy_less_work_plus_loss_stays_in_every_kind_of_run():
    scene = scene_of("all")
    for how in (
        {"tol": 1e-10},
        {"dt": 0.04, "method": "rkn6"},
    ):
        run = simulate(scene, scene.at_rest(), 20.0, **how)
        assert run.energy_error < 1e-10
        assert run.loss[-1] > 0.1 * np.max(np.abs(run.energy))
        assert (np.diff(run.loss) > 0).all()


def test_what_is_recorded_changes_no_bit():
    scene = scene_of("all")
    for method in ("verlet", "rkn6"):
        ends = [
            simulate(scene, scene.at_rest(), 3.0, method=method, dt=0.1, record=record).final
            for record in (None, Record(every=7), Record(times=[0.37, 2.5]), Record(every=30))
        ]
        assert len({(end.u.tobytes(), end.v.tobytes()) for end in ends}) == 1
    run = simulate(scene, scene.at_rest(), 3.0, dt=0.02, method="rkn6", record=Record(times=[0.37]))
    fine = simulate(scene, scene.at_rest(), 0.37, dt=0.01, method="rkn6")
    np.testing.assert_allclose(run.u[0], fine.final.u, atol=1e-11)
    assert run.work[0] == pytest.approx(fine.work[-1], abs=1e-10)


@pytest.mark.parametrize("forcing", [
    {"drive": {4: Drive(displacement=(0.1 * sp.sin(T), 0.05 * (1 - sp.cos(T))))}},
    {"drive": {4: Drive(force=(None, 0.2 * sp.sin(T)))}, "damping": Damping(ground=0.2)},
    {"drive": {4: Drive(displacement=(0.1 * sp.sin(T), None))},
     "damping": Damping(ground=np.linspace(0, 0.3, 9))},
    {"drive": {4: Drive(displacement=(None, 0.1 * sp.sin(T))), 6: Drive(force=(sp.sin(T), None))},
     "damping": Damping(bond=np.linspace(0, 0.4, 20), ground=0.05)},
    {"drive": {4: Drive(displacement=(0.1 * sp.sin(T), None))}, "damping": Damping(bond=0.1),
     "spring": CUBIC.over_time(k=1 + sp.sin(T) / 2)},
])  # fmt: skip
def test_networks_keep_order_and_balance(forcing):
    net = plate(**forcing)
    state = net.at_rest({8: (0.1, -0.2)})
    fine = simulate(net, state, 3.0, method="rkn6", dt=0.02)
    assert fine.energy_error < 1e-11
    steps = np.array([14, 20, 28])
    runs = [simulate(net, state, 3.0, method="rkn6", dt=3 / n) for n in steps]
    errors = [np.abs(run.final.u - fine.final.u).max() for run in runs]
    assert order_of(steps, errors) > 5.5
    for name in ("work", "loss") if "damping" in forcing else ("work",):
        gaps = [abs(getattr(run, name)[-1] - getattr(fine, name)[-1]) for run in runs]
        assert order_of(steps, gaps) > 5.3


def test_dashpots_in_bonds_that_turn_agree_with_another_integrator():
    """Motion, work and loss against DOP853, each with the order of the method."""
    g, ground = np.linspace(0, 0.4, 20), 0.05
    drive = {4: Drive(displacement=(0.1 * sp.sin(T), 0.05 * (1 - sp.cos(T))))}
    net = plate(drive=drive, damping=Damping(bond=g, ground=ground))
    i, j = net.bonds.T

    def slope(t, y):
        u, v = y[:36].reshape(2, 9, 2).copy()
        u[4], v[4] = (0.1 * np.sin(t), 0.05 * (1 - np.cos(t))), (0.1 * np.cos(t), 0.05 * np.sin(t))
        along, force = directions(net, u), net.forces(u) - ground * v
        speed = np.sum(along * (v[j] - v[i]), axis=1)
        np.add.at(force, i, (g * speed)[:, None] * along)
        np.subtract.at(force, j, (g * speed)[:, None] * along)
        acceleration = force / 0.5
        acceleration[4] = -0.1 * np.sin(t), 0.05 * np.cos(t)
        acceleration[[0, 2]] = 0
        power = (0.5 * acceleration[4] - force[4]) @ v[4]
        rates = power, np.sum(g * speed**2) + ground * np.sum(v**2)
        return np.concatenate([v.ravel(), acceleration.ravel(), rates])

    state = net.at_rest({8: (0.1, -0.2)})
    begun = np.concatenate([state.u.ravel(), state.v.ravel(), [0, 0]])
    end = solve_ivp(slope, (0, 3), begun, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    for method, counts in (("verlet", (20, 40)), ("rkn6", (14, 20, 28))):
        steps, errors = np.array(counts), []
        for count in counts:
            run = simulate(net, state, 3.0, method=method, dt=3 / count)
            found = *run.final.u.ravel(), *run.final.v.ravel(), run.work[-1], run.loss[-1]
            errors.append(np.abs(np.array(found) - end).max())
        assert order_of(steps, errors) > ORDERS[method] - 0.2
        assert errors[-1] < {"verlet": 1e-3}.get(method, 1e-10)


def test_dashpots_in_bonds_keep_momentum_and_angular_momentum():
    places = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    bonds = [(i, j) for i in range(4) for j in range(i)]
    net = Network(places, bonds, CUBIC, mass=[1, 2, 3, 4], damping=Damping(bond=0.5))
    state = State(np.zeros((4, 3)), np.random.default_rng(1).normal(size=(4, 3)))
    run = simulate(net, state, 5.0, tol=1e-12)
    np.testing.assert_allclose(net.momentum(run.final), net.momentum(state), atol=1e-13)
    spin = angular_momentum(net, run.final), angular_momentum(net, state)
    np.testing.assert_allclose(*spin, atol=1e-12)
    assert run.energy_error < 1e-12
    assert run.loss[-1] > 0.3 * run.energy[0]


@pytest.mark.parametrize("name", [*SCENES, "ground", "bond"])
def test_elongations_met_are_those_of_all_steps(name):
    """Kicks of verlet fall on its steps: there is nothing else to be met."""
    if name in SCENES:
        scene, blow = scene_of(name), 0.3
    else:
        drive = {4: Drive(displacement=(0.1 * sp.sin(T), None))}
        scene, blow = plate(drive=drive, damping=Damping(**{name: 0.1})), (0.3, 0.0)
    run = simulate(scene, scene.at_rest({5: blow}), 3.0, dt=0.05, record=Record(every=1))
    r = scene.elongation(run.u)
    found = run.elongation_range[:, 0].min(), run.elongation_range[:, 1].max()
    np.testing.assert_allclose(found, (min(r.min(), 0), max(r.max(), 0)), atol=1e-15)


def test_bonds_that_do_not_turn_are_damped_as_those_of_the_chain():
    """Another solution of the drift: a row in space, moved along itself."""
    places = np.zeros((5, 3))
    places[:, 0] = np.arange(5)
    row, damping = [(k, k + 1) for k in range(4)], Damping(bond=0.3, ground=0.1)
    net = Network(places, row, CUBIC, drive={0: Drive(displacement=(SHAKER.displacement, 0, 0))},
                  damping=damping)  # fmt: skip
    chain = Chain(CUBIC, 5, drive={0: SHAKER}, damping=damping)
    runs = [simulate(x, x.at_rest(), 3.0, dt=0.05, method="rkn6") for x in (chain, net)]
    np.testing.assert_allclose(runs[0].u, runs[1].u[..., 0], atol=1e-11)
    np.testing.assert_allclose(runs[0].loss, runs[1].loss, atol=1e-11)


def test_a_network_on_a_line_is_driven_as_the_chain():
    chain = Chain(CUBIC, 4, drive={0: SHAKER}, damping=Damping(bond=0.1, ground=0.2))
    net = Network(
        np.arange(4.0)[:, None], [(0, 1), (1, 2), (2, 3)], CUBIC, drive={0: SHAKER},
        damping=Damping(bond=0.1, ground=0.2),
    )  # fmt: skip
    runs = [simulate(x, x.at_rest(), 3.0, dt=0.05, method="rkn6") for x in (chain, net)]
    np.testing.assert_array_equal(runs[0].u, runs[1].u[..., 0])
    np.testing.assert_array_equal(runs[0].work, runs[1].work)


def test_samples_are_joined_by_a_smooth_curve():
    t = np.linspace(0, 4, 161)
    sampled = Drive(displacement=(t, 0.3 * np.sin(1.3 * t)))
    ends = []
    for drive in (sampled, SHAKER):
        chain = Chain(CUBIC, 8, drive={0: drive})
        ends.append(simulate(chain, chain.at_rest(), 4.0, tol=1e-9).final.u)
    np.testing.assert_allclose(*ends, atol=1e-7)


def test_a_drive_of_nothing_leaves_the_conservative_motion():
    free = Chain(CUBIC, 8)
    idle = Chain(CUBIC, 8, drive={3: Drive(force=0.0)}, damping=Damping())
    state = free.at_rest({0: 0.4})
    runs = [simulate(x, state, 5.0, dt=0.05, method="rkn6") for x in (free, idle)]
    np.testing.assert_allclose(runs[0].u, runs[1].u, atol=1e-15)
    assert runs[0].work is None
    assert not runs[1].work.any()
    undamped = Chain(CUBIC, 8, damping=Damping())
    assert simulate(undamped, state, 1.0).work is None


def test_default_steps_follow_what_a_drive_brings_in():
    """At rest nothing tells how stiff the springs will be."""
    lock = Potential(-sp.log(1 - R**2) / 2, R, length=1.0, domain=(-1.0, 1.0))
    drive = {0: Drive(displacement=0.4 * sp.sin(2 * T))}
    chain = Chain(lock, 3, drive=drive, damping=Damping(bond=0.5))
    run = simulate(chain, chain.at_rest(), 6.0)
    exact = simulate(chain, chain.at_rest(), 6.0, tol=1e-9)
    assert exact.error_estimate < 1e-9
    np.testing.assert_allclose(run.final.u, exact.final.u, atol=1e-5)
    assert run.energy_error < 1e-6


def test_a_spring_that_is_driven_into_its_end_says_where_and_when():
    spring = Prism(1.0, 0.7, 0.01, 1.0).potential()
    drive = {4: Drive(displacement=-0.1 * T)}
    chain = Chain(spring, 5, 1.0, ("fixed", "free"), drive=drive, damping=Damping(1e-3))
    with pytest.raises(LockingError, match=r"the spring between sites \d and \d got there") as one:
        simulate(chain, chain.at_rest(), 20.0, dt=0.02)
    run = one.value.run
    assert not run.complete
    assert 1 < run.t[-1] < 20
    assert run.work[-1] > 0


@pytest.mark.parametrize("others", [0.0, 0.1])
def test_a_dashpot_from_a_held_site_to_the_ground_changes_nothing(others):
    runs = []
    for held in (0.0, 1e6):
        ground, bond = [held, *[others] * 6, held], 0.0 if others else 0.1
        chain = Chain(CUBIC, 8, 1.0, ("fixed", "fixed"), damping=Damping(bond, ground))
        runs.append(simulate(chain, chain.at_rest({3: 0.3}), 5.0))
    free, rubbed = runs
    assert free.dt == rubbed.dt
    np.testing.assert_array_equal(free.u, rubbed.u)
    assert free.loss[-1] == rubbed.loss[-1] > 0


def test_beads_are_driven_through_the_builders():
    steel = granular.materials["steel"]
    bead = granular.Bead(0.005, steel)
    shake = {0: Drive(displacement=1e-8 * sp.sin(1e5 * T))}
    row = granular.chain([bead] * 6, preload=10.0, drive=shake, damping=Damping(bond=0.5))
    run = simulate(row, row.start(), 2e-4, tol=1e-8)
    assert run.energy_error < 1e-9
    assert run.u[-1, 1].any()
    guide = granular.y_guide(4, 4, bead=bead, drive={0: Drive(force=(1e5 * T, None))},
                             damping=Damping(ground=0.01))  # fmt: skip
    run = simulate(guide, guide.at_rest(), 5e-5, dt=5e-8)
    assert run.energy_error < 1e-3
    assert run.work[-1] > run.loss[-1] > 0
    pack = granular.hexagonal_pack(3, 3, bead=bead, floor=steel, contacts="fixed",
                                   drive={4: Drive(force=(0.0, -1e5 * T))})  # fmt: skip
    run = simulate(pack, pack.at_rest(), 5e-5, dt=5e-8)
    assert run.impulse[-1].any()
    assert run.energy_error < 1e-3


def test_modes_leave_prescribed_sites_where_they_are():
    moved = modes(Chain(CUBIC, 6, drive={0: SHAKER}), State(np.zeros(6), np.zeros(6)))
    held = modes(Chain(CUBIC, 6, ends=("fixed", "free")))
    np.testing.assert_allclose(moved.frequencies, held.frequencies, atol=1e-14)


def test_a_run_of_functions_of_time_is_kept_as_what_it_prints(tmp_path):
    scene = scene_of("all")
    run = simulate(scene, scene.at_rest(), 1.0, dt=0.1)
    run.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.work, run.work)
    with pytest.raises(TensegrityError, match="build the scene again"):
        _ = again.scene.mass


def run(forcing, t_end, **how):
    chain = Chain(CUBIC, 8, **(forcing() if callable(forcing) else forcing))
    return simulate(chain, chain.at_rest(), t_end, **how)


def test_bad_input_says_what_and_why():
    def refused(text, forcing, t_end=2.0, error=TensegrityError, **how):
        with pytest.raises(error, match=text):
            run(forcing, t_end, **({"dt": 0.05} | how))

    def moved(x):
        return lambda: {"drive": {0: Drive(displacement=x)}}

    refused("one of displacement and force, not 0", moved(None))
    refused(r"ground damping -0\.1 N s/m must be at least 0",
            lambda: {"damping": Damping(ground=-0.1)})  # fmt: skip
    refused("depends on w, must depend on t alone", moved(sp.Symbol("w") * T))
    refused(r"jumps by 0\.05 at t = 1 s", moved(0.1 * sp.Heaviside(T - 1)))
    refused(r"jumps by 0\.2", {"drive": {2: Drive(force=0.1 * sp.sign(sp.sin(3 * T)))}})
    refused("displacement sqrt.* is nan at t = 1", moved(sp.sqrt(1 - T) - 1))
    refused("is zoo|is inf|not a number|cannot be translated", moved(1 / T))
    refused("time 1 s of the samples .* follows 1 s", moved(([0.0, 1.0, 1.0], [0.0, 0.0, 1.0])))
    refused("is nan at index 1, must be finite", moved(([0.0, 1.0], [0.0, math.nan])))
    refused("do not reach from 0 to 2 s", moved(([0.0, 1.0], [0.0, 1.0])))
    refused(r"bond damping has shape \(3,\), must be \(7,\)", {"damping": Damping(bond=[1, 2, 3])})
    refused("driven site 8 must be below 8", {"drive": {8: SHAKER}})
    refused("site 0 is held", {"drive": {0: SHAKER}, "ends": ("fixed", "free")})
    refused("has 2 components, must have 1", moved((T, T)))
    refused("'midpoint' is not a splitting", {"drive": {0: SHAKER}}, method="midpoint")
    refused("'corrected6' is not a splitting", {"drive": {0: SHAKER}}, method="corrected6")
    refused(r"dt 0.5 s is beyond 0.\d+ s for dashpots", {"damping": Damping(ground=20.0)}, dt=0.5,
            error=StabilityError)  # fmt: skip
    chain = Chain(CUBIC, 8, drive={0: Drive(displacement=0.1 * sp.cos(T))})
    with pytest.raises(TensegrityError, match=r"site 0 is at 0 m, its drive .* begins at 0.1 m"):
        simulate(chain, State(np.zeros(8), np.zeros(8)), 1.0, dt=0.1)
    with pytest.raises(TensegrityError, match=r"bond damping has shape \(9,\), must be \(20,\)"):
        plate(damping=Damping(bond=np.ones(9)))


class Column:
    """What converts to an array, as a column of a table of pandas does."""

    def __init__(self, values):
        self.values = np.asarray(values)

    def __array__(self, dtype=None, copy=None):
        return self.values.astype(dtype or float)

    def __len__(self):
        return len(self.values)


def test_samples_may_be_columns_of_a_table():
    t = np.linspace(0, 1, 21)
    force, plane = (Drive(force=(Column(t), Column(x))) for x in (np.sin(t), np.eye(21)[:, :2]))
    np.testing.assert_array_equal(force.at(t)[0], Drive(force=(t, np.sin(t))).at(t)[0])
    assert plane.at(t).shape == (2, 21)
    with pytest.raises(TensegrityError, match="has 1 components, must have 2"):
        plate(drive={0: force})


def test_a_spike_of_few_of_many_samples_limits_the_steps():
    """The momentum of a spike between the points at which any other drive is searched."""
    t = np.arange(200_001) / 2e5
    spike = np.where(np.abs(t - 0.40013) < 1.01e-5, 1e4, 0.0)
    chain = Chain(CUBIC, 8, drive={3: Drive(force=(t, spike))})
    run = simulate(chain, chain.at_rest(), 1.0, tol=1e-4)
    given = spike.sum() * t[1]
    assert np.sum(chain.mass * run.final.v) == pytest.approx(given, rel=1e-4)
