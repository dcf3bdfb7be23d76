"""Motion of structures whose bars have mass, against closed forms and an independent integrator."""

import math
import pickle

import numpy as np
import pytest
import sympy as sp
from heavy import dense_mass, integrated
from hypothesis import given, settings
from hypothesis import strategies as st

import tensegrity as ts
from tensegrity import (
    Damping,
    Drive,
    Ensemble,
    Force,
    Network,
    Potential,
    Record,
    State,
    Structure,
    TensegrityError,
    angular_momentum,
    catalogue,
    gradient,
    objective,
    resume,
    simulate,
)

OCTAHEDRON = catalogue.expandable_octahedron(strut=1.0, prestrain=0.05, k_bar=100.0)
T = sp.Symbol("t")


def heavy(structure, bar_mass=1.0, string_mass=None, mass=0.0):
    given = {"bar_mass": bar_mass, "string_mass": string_mass, "mass": mass}
    return structure.at(structure.positions, **given)


def bar(length, k, natural, mass, dim=2):
    ends = np.zeros((2, dim))
    ends[1, 0] = length
    return Structure(ends, [(0, 1)], k_bar=k, natural_lengths=[natural], bar_mass=mass)


def shaken(scene, size=0.3, seed=0):
    v = size * np.random.default_rng(seed).normal(size=scene.shape)
    v[list(scene.held)] = 0
    return State(np.zeros(scene.shape), v)


# single bars


def test_a_free_bar_in_steady_rotation_keeps_its_length_tension_and_angular_momentum():
    k, natural, m, w = 400.0, 1.2, 3.0, 2.0
    length = natural / (1 - m * w**2 / (12 * k))
    net = bar(length, k, natural, m).network()
    v = np.array([[0, -w * length / 2], [0, w * length / 2]])
    start = State(np.zeros((2, 2)), v)
    run = simulate(net, start, 10.0, tol=1e-10)
    end = net.positions[1] + run.final.u[1] - [length / 2, 0]
    assert end == pytest.approx([0.24546289432384477, 0.5491400004376707], abs=1e-9)
    assert net.bond_tension(run.final.u) == pytest.approx([m * length * w**2 / 12], rel=1e-8)
    turning = m * length**2 * w / 12
    assert angular_momentum(net, start) == pytest.approx(turning, rel=1e-13)
    assert angular_momentum(net, run.final) == pytest.approx(turning, rel=1e-11)
    assert net.energy(run.final) == pytest.approx(net.energy(start), rel=1e-11)
    kinetic = net.energy(start) - float(net.bond_energy(start.u)[0])
    assert kinetic == pytest.approx(m * length**2 * w**2 / 24, rel=1e-12)


def test_a_bar_held_at_one_end_turns_with_a_third_of_its_mass_there():
    k, natural, m, w = 400.0, 1.2, 3.0, 2.0
    length = natural / (1 - m * w**2 / (3 * k))
    net = bar(length, k, natural, m).network(held=[0])
    start = State(np.zeros((2, 2)), np.array([[0, 0], [0, w * length]]))
    run = simulate(net, start, 10.0, tol=1e-10)
    end = net.positions[1] + run.final.u[1]
    assert end == pytest.approx([0.4946449234101721, 1.106600303912276], abs=1e-9)
    assert net.bond_tension(run.final.u) == pytest.approx([m * length * w**2 / 3], rel=1e-8)
    tension = m * length * w**2 / 3
    exact = m * length**2 * w**2 / 6 + tension**2 / (2 * k)
    assert net.energy(start) == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("axes", ["all", "one"])
def test_the_end_of_a_driven_bar_moves_by_k_plus_m_w2_6_over_k_minus_m_w2_3(dim, axes):
    k, m, size, w = 400.0, 3.0, 0.01, 7.0
    x = size * (k + m * w**2 / 6) / (k - m * w**2 / 3)
    assert x == pytest.approx(0.012094017094017095, rel=1e-14)
    others = [None if axes == "one" else sp.Integer(0)] * (dim - 1)
    drive = Drive(displacement=(size * sp.sin(w * T), *others))
    net = bar(1.0, k, 1.0, m, dim).network(drive={0: drive})
    start = net.at_rest({1: (x * w, *[0.0] * (dim - 1))})
    run = simulate(net, start, 3.0, tol=1e-10, record=Record(times=[1.0, 2.0, 3.0]))
    assert run.method == "rk8"
    assert run.u[:, 1, 0] == pytest.approx(x * np.sin(w * run.t), abs=1e-11)
    energies = [net.energy(State(*pair)) for pair in zip(run.u, run.v, strict=True)]
    assert energies - run.work == pytest.approx(net.energy(start), abs=1e-11)


# whole structures


def t_bar(lump=False):
    """TsgFEM's T-bar; its strings push as well as pull."""
    nodes = [(-1, 0, 0), (0, -1, 0), (1, 0, 0), (0, 1, 0)]
    ends = [(0, 2), (1, 3), (0, 1), (1, 2), (2, 3), (3, 0)]
    ea = np.array([28723844.188903145] * 2 + [2828.4271247461897] * 4)
    natural = np.array([2.000139266823317] * 2 + [0.6599663291074443, 0.9428090415820635] * 2)
    bars, strings = 19.150562885446647, 2.2666666666666666
    given = {"bar_mass": [bars] * 2 + [strings] * 4}
    if lump:
        given = {"bar_mass": [bars] * 2 + [0] * 4, "mass": strings}
    return Structure(nodes, ends, k_bar=ea / natural, natural_lengths=natural, **given)


@pytest.mark.parametrize(
    ("lump", "wanted"),
    [
        (False, (1.02707693566, 1.76820677850, 1.99984)),
        (True, (1.00439097213, 1.90447670858, 1.99984)),
    ],
)
def test_t_bar_of_tsgfem_arrives_where_two_integrators_say(lump, wanted):
    net = t_bar(lump).network()
    start = State(np.zeros(net.shape), np.full(net.shape, 2.0))
    run = simulate(net, start, 0.99992, tol=1e-9, record=Record(every=10**9))
    assert net.positions[0] + run.final.u[0] == pytest.approx(wanted, abs=2e-9)


@pytest.mark.parametrize("method", ["verlet", "rkn6"])
def test_splittings_keep_their_order(method):
    net = t_bar().network()
    start = State(np.zeros(net.shape), np.full(net.shape, 2.0))
    counts = {"verlet": (1000, 2000, 4000), "rkn6": (100, 150, 225)}[method]
    ends = [simulate(net, start, 0.05, dt=0.05 / n, method=method).final.u for n in counts]
    exact = simulate(net, start, 0.05, dt=0.05 / 8000, method="rkn6").final.u
    errors = [np.abs(u - exact).max() for u in ends]
    pairs = zip(errors, errors[1:], counts, counts[1:], strict=False)
    order = [math.log(a / b) / math.log(n / m) for a, b, m, n in pairs]
    wanted = {"verlet": 2, "rkn6": 6}[method]
    assert min(order) > wanted - 0.15


CASES = {
    "class 1": heavy(OCTAHEDRON, [1.0, 0.5, 1.5, 0.7, 1.2, 0.9]),
    "class 1 and nodes": heavy(OCTAHEDRON, 1.0, None, 0.2),
    "all members": heavy(OCTAHEDRON, 1.0, 0.05, 0.0),
    "plane": heavy(catalogue.snelson_x(prestrain=0.1, k_bar=10.0), 1.0, 0.2, 0.1),
}


@pytest.mark.parametrize(("name", "held"), [*zip(CASES, [(), (0, 1), (), (0,)], strict=True)])
def test_structures_move_as_with_another_integrator_through_slack(name, held):
    s = CASES[name]
    net = s.network(held=held)
    start = shaken(net)
    run = simulate(net, start, 2.0, tol=1e-8, record=Record(every=10**9))
    assert run.method == "corrected6"
    assert s.at(s.positions + run.final.u).slack.any()
    u, v = integrated(s, start.u, start.v, 2.0, held, dt_max=5e-3)
    assert run.final.u == pytest.approx(u, abs=1e-6)  # the integrator does not see the kinks
    assert run.final.v == pytest.approx(v, abs=1e-5)
    assert net.energy(run.final) == pytest.approx(net.energy(start), rel=1e-8)
    if not held:
        assert net.momentum(run.final) == pytest.approx(net.momentum(start), abs=1e-12)
        turned = angular_momentum(net, run.final)
        assert turned == pytest.approx(angular_momentum(net, start), abs=1e-8)


def test_corrected_steps_keep_their_order_where_strings_of_heavy_bars_go_slack():
    net = CASES["all members"].network()
    start = shaken(net, 0.6)
    steps = (600, 1200, 2400)
    ends = [simulate(net, start, 3.0, dt=3.0 / n, method="corrected6").final.u for n in steps]
    plain = [simulate(net, start, 3.0, dt=3.0 / n, method="rkn6").final.u for n in steps]
    exact = simulate(net, start, 3.0, dt=3.0 / 60000, method="corrected6").final.u
    of, without = (np.abs(np.array(x)[-1] - exact).max() for x in (ends, plain))
    assert of < 1e-3 * without


def test_dashpots_forces_and_driven_nodes_act_as_with_another_integrator():
    s = heavy(OCTAHEDRON.at(OCTAHEDRON.positions, bars=OCTAHEDRON.ends, strings=[], k_bar=50.0,
                            k_string=1.0), 0.4, None, 0.05)  # fmt: skip
    c, pull = 0.3, 0.2
    wave = 0.05 * sp.sin(3 * T)
    drive = {0: Drive(displacement=(wave, wave / 2, sp.Integer(0))),
             1: Drive(displacement=(wave / 3, sp.Integer(0), wave)),
             5: Drive(force=(pull * sp.cos(2 * T), sp.Integer(0), sp.Integer(0)))}  # fmt: skip
    forces = [Force([-0.1 * sp.Symbol(f"u_{a}") for a in "xyz"], at=[7])]
    net = s.network(drive=drive, damping=Damping(ground=c), forces=forces, held=[2])
    start = net.at_rest({6: (0.3, -0.2, 0.1), 8: (0.0, 0.2, 0.4)})
    run = simulate(net, start, 2.0, tol=1e-9, record=Record(times=[0.7, 1.4, 2.0]))

    def extra(t, u, v):
        force = -c * v
        force[5, 0] += pull * np.cos(2 * t)
        force[7] -= 0.1 * u[7]
        return force

    def motion(*sizes):
        sizes = 0.05 * np.array(sizes)
        return (lambda t: sizes * np.sin(3 * t), lambda t: 3 * sizes * np.cos(3 * t),
                lambda t: -9 * sizes * np.sin(3 * t))  # fmt: skip

    driven = {0: motion(1, 0.5, 0), 1: motion(1 / 3, 0, 1)}
    u, v = integrated(s, start.u, start.v, 2.0, (2,), extra, driven)
    assert run.final.u == pytest.approx(u, abs=1e-8)
    assert run.final.v == pytest.approx(v, abs=1e-7)
    energies = np.array([net.energy(State(*p)) for p in zip(run.u, run.v, strict=True)])
    assert energies - run.work + run.loss == pytest.approx(net.energy(start), abs=1e-9)


def test_strings_that_are_wound_move_heavy_bars_and_their_work_is_the_energy_gained():
    s = heavy(catalogue.snelson_x(prestrain=0.1, k_bar=10.0), 1.0, None, 0.1)
    r, k, pull = sp.symbols("r k pull")
    laws = [Potential(k * r**2 / 2 + pull * r, r, parameters={"k": float(x), "pull": 0.0})
            for x in s.stiffnesses]  # fmt: skip
    laws = [law if n != 3 else law.over_time(pull=0.2 * sp.sin(2 * T) ** 2)
            for n, law in enumerate(laws)]  # fmt: skip
    net = Network(s.positions, s.ends, laws, lengths=s.natural_lengths, mass=s.mass,
                  bond_mass=s.member_mass)  # fmt: skip
    run = simulate(net, net.at_rest(), 3.0, tol=1e-9, record=Record(times=[1.0, 2.0, 3.0]))
    i, j = s.ends[3]

    def extra(t, u, v):
        d = s.positions[j] + u[j] - s.positions[i] - u[i]
        force = np.zeros_like(u)
        force[i] = 0.2 * np.sin(2 * t) ** 2 * d / np.linalg.norm(d)
        force[j] = -force[i]
        return force

    bars = s.at(s.positions, bars=s.ends, strings=[], k_bar=s.stiffnesses, k_string=1.0,
                bar_mass=s.member_mass, string_mass=None)  # fmt: skip
    u, _ = integrated(bars, np.zeros(net.shape), np.zeros(net.shape), 3.0, extra=extra)
    assert run.final.u == pytest.approx(u, abs=1e-8)
    assert run.energy - run.work == pytest.approx(run.energy[0] - run.work[0], abs=1e-9)


# limits, invariance


SCALES = st.tuples(
    st.floats(1e3, 1e8), st.floats(1e-5, 1e2), st.floats(1e-6, 1e3), st.integers(0, 10**6)
)


def scaled(s, length, k, mass):
    of = {"k_bar": k * s.stiffnesses[: s.bars], "k_string": k * s.stiffnesses[s.bars :],
          "natural_lengths": length * s.natural_lengths, "mass": mass * s.mass}  # fmt: skip
    if s.has_heavy_members:
        of |= {"bar_mass": mass * s.member_mass[: s.bars],
               "string_mass": mass * s.member_mass[s.bars :]}  # fmt: skip
    return s.at(length * s.positions, **of)


@given(SCALES)
@settings(max_examples=10, deadline=None)
def test_motion_does_not_depend_on_units(scales):
    ea, length, mass, seed = scales
    s = CASES["all members"]
    k = ea / length / 100
    other, unit = scaled(s, length, k, mass), math.sqrt(mass / k)
    start = shaken(s.network(), 0.3, seed)
    run = simulate(s.network(), start, 1.0, dt=1e-3)
    there = State(length * start.u, length / unit * start.v)
    found = simulate(other.network(), there, unit, dt=1e-3 * unit)
    assert found.steps == run.steps
    assert found.final.u / length == pytest.approx(run.final.u, abs=1e-9)


@given(SCALES)
@settings(max_examples=10, deadline=None)
def test_bars_without_mass_in_the_limit_move_as_lumped(scales):
    ea, length, mass, seed = scales
    s = scaled(OCTAHEDRON, length, ea / length / 100, mass)
    light = s.at(s.positions, bar_mass=1e-13 * mass, string_mass=1e-14 * mass)
    unit = math.sqrt(mass * length / ea)
    start = State(np.zeros((12, 3)), length / unit * shaken(s.network(), 0.03, seed).v)
    ends = [simulate(x.network(), start, 3 * unit, dt=0.01 * unit).final.u for x in (s, light)]
    assert ends[1] / length == pytest.approx(ends[0] / length, abs=1e-10)


def test_motion_does_not_depend_on_the_order_of_nodes():
    s, rng = CASES["all members"], np.random.default_rng(5)
    order = rng.permutation(s.nodes)
    place = np.argsort(order)
    other = s.at(s.positions[order], bars=place[s.ends[: s.bars]], strings=place[s.ends[s.bars :]],
                 mass=s.mass[order])  # fmt: skip
    start = shaken(s.network())
    run = simulate(s.network(), start, 2.0, dt=0.005)
    found = simulate(other.network(), State(start.u[order], start.v[order]), 2.0, dt=0.005)
    assert found.final.u == pytest.approx(run.final.u[order], abs=1e-11)


def test_large_networks_of_several_tiles_and_pieces_move_as_dense_matrices_say():
    q = 0.1 / 1.1
    cell = ts.Lattice([(0, 0), (0, 1)], [(1, 0)], bars=[(0, 1, 1), (1, 0, 1)],
                      strings=[(0, 0, 1), (1, 1, 1), (0, 1)], k_bar=10, k_string=[1, 1, 2],
                      mass=0.2, bar_mass=1.0).prestressed([-q, -q, q, q, 2 * q])  # fmt: skip
    net = cell.network(300)
    start = net.at_rest({300: (0.02, 0.1)})
    run = simulate(net, start, 0.4, dt=0.01, record=Record(every=10**9))
    mass = dense_mass(cell.tile(300))
    free = np.setdiff1d(np.arange(net.sites), net.held)
    inverse = np.linalg.inv(mass[np.ix_(free, free)])
    u, v = start.u.copy(), start.v.copy()
    for _ in range(40):
        v[free] += 0.005 * (inverse @ net.forces(u)[free])
        u += 0.01 * v
        v[free] += 0.005 * (inverse @ net.forces(u)[free])
    assert run.final.u == pytest.approx(u, abs=1e-13)
    assert np.count_nonzero(np.abs(run.final.u).max(axis=1)) > 20


# what else a scene says


def test_energies_momenta_modes_and_files_know_the_mass_of_bonds(tmp_path):
    s = CASES["all members"]
    net, start = s.network(), shaken(s.network())
    kinetic = 0.5 * np.sum(start.v * (dense_mass(s) @ start.v))
    stored = float(np.sum(net.bond_energy(start.u)))
    assert net.energy(start) == pytest.approx(kinetic + stored, rel=1e-14)
    assert net.site_energy(start).sum() == pytest.approx(net.energy(start), rel=1e-13)
    assert net.momentum(start) == pytest.approx(s.weighing_mass @ start.v, abs=1e-14)
    turning = np.cross(s.positions, dense_mass(s) @ start.v).sum(axis=0)
    assert angular_momentum(net, start) == pytest.approx(turning, rel=1e-12)
    assert ts.modes(net, count=40).frequencies[6:] == pytest.approx(s.modes(30).frequencies)
    assert pickle.loads(pickle.dumps(net)) == net != OCTAHEDRON.network()
    record = Record(every=1, path=tmp_path / "rows.npy", checkpoint=0)
    whole = simulate(net, start, 1.0, dt=0.01)
    simulate(net, start, 1.0, dt=0.01, record=record, observe=lambda t, u, v: t > 0.5)
    again = resume(tmp_path / "rows.npy")
    assert np.array_equal(again.final.u, whole.final.u)
    assert again.scene == net
    both = Ensemble([net, CASES["class 1"].network()])
    pair = simulate(both, State(*(np.stack([x, x], -1) for x in (start.u, start.v))), 1.0, dt=0.01)
    assert np.array_equal(pair[0].final.u, whole.final.u)


@pytest.mark.parametrize("name", ["class 1", "all members"])
def test_gradients_by_masses_of_bars_are_those_of_differences(name):
    s, seen = CASES[name], [objective.displacement(3, axis=1), objective.peak(objective.load(2))]
    start, h = shaken(s.network()), 1e-6

    def values(of, state=start):
        return np.array([g.value for g in gradient(seen, of.network(), state, 2.0, dt=0.005)])

    found = gradient(seen, s.network(), start, 2.0, dt=0.005)
    masses = {"bar_mass": s.member_mass[:6], "string_mass": s.member_mass[6:], "mass": s.mass}
    for argument, place in (("bar_mass", 2), ("string_mass", 5), ("mass", 3)):
        if argument == "string_mass" and not s.member_mass[6:].any():
            continue
        step = h * np.eye(len(masses[argument]))[place]
        ends = [s.at(s.positions, **masses | {argument: masses[argument] + x})
                for x in (step, 2 * step)]  # fmt: skip
        first, second = (values(x) for x in ends)
        slope = (4 * first - 3 * values(s) - second) / (2 * h)
        number = {"bar_mass": place, "string_mass": 6 + place}.get(argument)
        by = [g.mass[place] if number is None else g.by("bond_mass")[number] for g in found]
        assert by == pytest.approx(slope, rel=1e-4, abs=1e-6)


def test_contacts_that_form_act_on_heavy_bars():
    s = heavy(OCTAHEDRON, 0.2, None, 0.02)
    law, floor = ts.PowerLaw(1e5, 1.5), ts.Wall((0, 0, -0.6), (0, 0, 1))
    weight = -9.81 * s.weighing_mass[:, None] * [0, 0, 1.0]
    plain = s.network()
    net = Network(s.positions, s.ends, plain.springs, lengths=s.natural_lengths, mass=s.mass,
                  bond_mass=s.member_mass, radius=0.05, walls=[floor], contacts="follow", law=law,
                  loads=weight)  # fmt: skip
    run = simulate(net, net.at_rest(), 0.4, tol=1e-8)
    assert net.energy(run.final) == pytest.approx(net.energy(net.at_rest()), abs=1e-7)
    low = np.min(s.positions[:, 2] + run.final.u[:, 2])  # free fall ends at -1.28
    assert -0.6 < low < -0.5


# bad input


def test_what_does_not_take_bonds_with_mass_says_so():
    s = CASES["class 1"]
    net, start = s.network(), shaken(s.network())
    jump = sp.Piecewise((0, T < 1), (T - 1, True))
    driven = s.network(drive={0: Drive(displacement=(jump, 0.0, 0.0))})
    pushed = s.network(drive={0: Drive(force=(1.0, 0.0, 0.0))})
    calls = {
        "midpoint": lambda: simulate(net, start, 1.0, dt=0.01, method="midpoint"),
        "need rk4 or rk8": lambda: simulate(pushed, start, 1.0, dt=0.01, method="verlet"),
        "may jump": lambda: simulate(driven, driven.at_rest(), 1.0, dt=0.01),
        "periodic orbits: not for": lambda: ts.periodic_orbit(net, start, period=1.0),
        "no gradient: take displacements": lambda: gradient(
            objective.velocity(0), net, start, 1.0, dt=0.01
        ),
        "beside drives": lambda: gradient(
            objective.displacement(0), pushed, start, 1.0, dt=0.01
        ),
        "bond_mass -1 kg of bond 0": lambda: Network(
            net.positions, net.bonds, net.springs, bond_mass=-1.0
        ),
        "site 2 has mass 0 kg": lambda: Network(
            [[0, 0], [1, 0], [2, 0]], [[0, 1], [1, 2]], ts.PowerLaw(1.0, 1.5), bond_mass=[1, 0]
        ),
        "waves of permanent form": lambda: ts.solitary_wave(
            Network([[0, 0], [1, 0], [2, 0]], [[0, 1], [1, 2]], ts.PowerLaw(1.0, 1.5),
                    bond_mass=1.0), amplitude=-0.1
        ),
    }  # fmt: skip
    for words, call in calls.items():
        with pytest.raises(TensegrityError, match=words):
            call()
