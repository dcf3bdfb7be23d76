"""Driven, damped and changing scenes in files, in lanes, and as networks of springs that change."""

import math
import os

import numpy as np
import pytest
import sympy as sp
from networks import plate
from scipy.integrate import solve_ivp
from springs import series
from test_resume import changing, moved, moved_lanes, shaken

import granular
from tensegrity import (
    Chain,
    Damping,
    Drive,
    Ensemble,
    LockingError,
    Network,
    Prism,
    Record,
    RecordError,
    Run,
    State,
    Wall,
    resume,
    simulate,
)

T = sp.Symbol("t")
CUBIC = series(0, 1 / 4, length=1.0)
PRISM = Prism(1.0, 0.8, 0.02, 1.0).potential()
PRESTRAIN = 0.02 + 0.01 * sp.sin(T / 2) ** 2
DRIVE = {0: Drive(displacement=0.3 * sp.sin(1.3 * T)), 4: Drive(force=0.1 * sp.cos(T))}
DAMPING = Damping(bond=0.2, ground=0.1)

SCENES = {f.__name__: f for f in (moved, changing, shaken, moved_lanes)}


# files


@pytest.mark.parametrize("name", SCENES)
def test_rows_in_a_file_are_those_in_memory(name, tmp_path):
    scene, state = SCENES[name]()
    how = {"method": "rkn6", "dt": 0.05}
    for k, when in enumerate(({"every": 3}, {"times": [0.0, 0.37, 0.4, 1.93]})):
        path = tmp_path / f"{k}.npy"
        memory = simulate(scene, state, 2.0, record=Record(**when), **how)
        file = simulate(scene, state, 2.0, record=Record(**when, path=path), **how)
        table = np.load(path, mmap_mode="r")
        for part in ("t", "u", "v", "energy", "work", "loss"):
            np.testing.assert_allclose(table[part], getattr(memory, part), rtol=1e-13, atol=1e-18)
            np.testing.assert_array_equal(table[part], getattr(file, part))
        assert file.energy_error < 1e-6
    assert memory.work.any()


def test_a_damped_scene_is_built_again_from_a_file(tmp_path):
    """And one that follows samples; only expressions are kept as what they print."""
    t = np.linspace(0, 2, 41)
    steel = granular.materials["steel"]
    bead = granular.Bead(0.005, steel)
    prism = Prism(1.0, 0.8, 0.02, 1.0).potential()
    scenes = [
        Chain(prism, 6, drive={0: Drive(displacement=(t, 0.01 * np.sin(t)))}, damping=DAMPING),
        plate(spring=prism, damping=Damping(bond=np.linspace(0, 1, 20))),
        granular.hexagonal_pack(3, 3, bead=bead, floor=steel, contacts="fixed",
                                damping=Damping(ground=0.01)),
    ]  # fmt: skip
    for number, scene in enumerate(scenes):
        record = Record(path=tmp_path / f"{number}.npy", checkpoint=0.0)
        run = simulate(scene, scene.at_rest(), 1e-6, dt=5e-8, record=record)
        run.save(tmp_path / "run.npz")
        again = Run.load(tmp_path / "run.npz").scene
        assert resume(record.path, again).complete  # recognised as the same
        end = simulate(again, again.at_rest(), 1e-6, dt=5e-8).final
        np.testing.assert_array_equal(end.u, run.final.u)


def test_a_disk_that_is_full_leaves_the_rows_before(tmp_path, monkeypatch):
    (scene, state), write, calls = shaken(), os.pwrite, []

    def full(*given):
        calls.append(given)
        if len(calls) > 12:
            raise OSError(28, "No space left on device")
        return write(*given)

    monkeypatch.setattr("os.pwrite", full)
    record = Record(path=tmp_path / "rows.npy")
    with pytest.raises(RecordError, match=r"No space left on device after \d rows") as caught:
        simulate(scene, state, 2.0, dt=0.05, method="rkn6", record=record)
    assert len(caught.value.run.t) == len(caught.value.run.work) > 1


# lanes


@pytest.mark.parametrize("how", [{"dt": 0.05, "method": "rkn6"}, {"tol": 1e-8}, {}])
def test_lanes_run_as_their_scenes_alone(how):
    """Some driven, some not; the step is that of the ensemble."""
    changing = CUBIC.over_time(k=1 + sp.sin(T) / 2)
    scenes = [Chain(changing, 8, drive=DRIVE, damping=DAMPING), Chain(CUBIC, 8),
              Chain(CUBIC, 8, [*[1.0] * 7, 2.0], damping=Damping(0.5))]  # fmt: skip
    together = Ensemble(scenes)
    state = together.at_rest({3: [0.1, 0.2, 0.3]})
    record = Record(times=[0.0, 0.31, 1.0, 2.0])
    run = simulate(together, state, 2.0, record=record, **how)
    work, loss, energy = np.zeros((3, len(run.t), 3))
    for lane, scene in enumerate(scenes):
        mine = together.select(state, lane)
        given = {"dt": run.dt, "method": run.method, "record": record}
        alone = simulate(scene, mine, 2.0, **given)
        if alone.work is not None:
            np.testing.assert_array_equal(run.u[..., lane], alone.u)
            np.testing.assert_array_equal(run.final.v[..., lane], alone.final.v)
            work[:, lane], loss[:, lane] = alone.work, alone.loss
        np.testing.assert_allclose(run.u[..., lane], alone.u, atol=1e-14)
        energy[:, lane] = alone.energy
    for one, other in ((run.work, work), (run.loss, loss), (run.energy, energy)):
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-17)
    assert run.energy_error < 1e-5


def test_lanes_tell_which_of_them_locks():
    spring = Prism(1.0, 0.7, 0.01, 1.0).potential()
    scenes = [Chain(spring, 5, 1.0, ("fixed", "free"), drive={4: Drive(displacement=-x * T)})
              for x in (0.01, 0.1)]  # fmt: skip
    together = Ensemble(scenes)
    with pytest.raises(LockingError, match=r"^scene 1: .* got there at t = ") as one:
        simulate(together, together.at_rest(), 20.0, dt=0.02, method="rkn6")
    run = one.value.run
    assert 1 < run.t[-1] < 20
    assert run.u.shape[1:] == (5, 2)
    assert run.energy_error < 1e-6


def test_lanes_of_networks_with_walls_keep_their_impulses():
    steel = granular.materials["steel"]
    bead = granular.Bead(0.005, steel)
    packs = [granular.hexagonal_pack(3, 3, bead=bead, floor=steel, contacts="fixed",
                                     drive={4: Drive(force=(0.0, -x * T))}, damping=Damping(0.2))
             for x in (1e5, 2e5)]  # fmt: skip
    together = Ensemble(packs)
    run = simulate(together, together.at_rest(), 2e-5, dt=5e-8, method="rkn6")
    for lane, pack in enumerate(packs):
        alone = simulate(pack, pack.at_rest(), 2e-5, dt=5e-8, method="rkn6")
        np.testing.assert_array_equal(run.u[..., lane], alone.u)
        np.testing.assert_array_equal(run.impulse[..., lane], alone.impulse)


# springs of networks that change


CHANGING = PRISM.over_time(prestrain=PRESTRAIN)
PHASES = [PRISM.over_time(prestrain=0.02 + 0.01 * sp.sin(T - k)) for k in range(2)]


@pytest.mark.parametrize("spring", [CHANGING, [*PHASES * 2, PRISM]], ids=["one", "each its own"])
def test_a_changing_row_in_the_plane_is_the_changing_chain(spring):
    """Another loop, the geometry of contacts, and the power of every bond apart."""
    chain = Chain(spring, 6)
    places = np.zeros((6, 2))
    places[:, 0] = PRISM.length * np.arange(6)
    net = Network(places, [(k, k + 1) for k in range(5)], spring)
    a = simulate(chain, chain.at_rest({0: 0.02}), 8.0, dt=0.1, method="rkn6")
    b = simulate(net, net.at_rest({0: (0.02, 0.0)}), 8.0, dt=0.1, method="rkn6")
    np.testing.assert_allclose(b.u[..., 0], a.u, atol=1e-15)
    np.testing.assert_allclose(b.work, a.work, atol=1e-17)
    np.testing.assert_allclose(b.energy, a.energy, atol=1e-17)
    np.testing.assert_allclose(b.elongation_range, a.elongation_range, atol=1e-15)
    assert abs(a.work[-1]) > 1e-6


def test_balance_of_energy_closes_in_every_kind_of_scene():
    for build in SCENES.values():
        run = simulate(*build(), 10.0, tol=1e-11)
        assert run.error_estimate < 1e-11
        assert run.energy_error < 1e-10


def test_a_changing_network_that_locks_says_where():
    place = np.array([(0.0, 0.0), (0.8, 0.0), (0.4, 0.7)])
    sides, lengths = [(0, 1), (1, 2), (0, 2)], PRISM.length
    net = Network(place, sides, CHANGING, lengths=lengths, held=[0, 1])
    state = State(np.zeros((3, 2)), [[0, 0], [0, 0], [0, -2.0]])
    with pytest.raises(LockingError, match=r"the spring between sites 2 and [01]|[01] and 2 got"):
        simulate(net, state, 2.0, dt=0.01, method="rkn6")
    net = Network(place, sides, PRISM.over_time(prestrain=0.02 - 0.01 * T), lengths=lengths)
    with pytest.raises(LockingError, match=r"prestrain .*driven there at t = 2") as one:
        simulate(net, net.at_rest(), 5.0, dt=0.1, method="rkn6")
    assert one.value.run.t[-1] == pytest.approx(1.9, abs=0.11)


def test_springs_change_beside_contacts_with_a_wall():
    """Two masses between springs, one of a wall: against a Runge-Kutta method, typed by hand."""
    wall, hard = Wall((0.0, 0.0), (1.0, 0.0)), series(k=9.0)
    net = Network(
        [[0.1, 0.0], [1.1, 0.0]], [(0, 1)], series(length=1.0).over_time(k=1 + sp.sin(T) / 2),
        walls=[wall], wall_contacts=[(0, 0)], wall_spring=hard, radius=0.1,
    )  # fmt: skip
    run = simulate(net, net.at_rest({1: (-0.3, 0.0)}), 3.0, tol=1e-10)

    def rates(t, y):
        pull, push = (1 + math.sin(t) / 2) * (y[1] - y[0]), -9 * y[0]
        return [y[2], y[3], pull + push, -pull]

    exact = solve_ivp(rates, (0, 3), [0, 0, 0, -0.3], "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    np.testing.assert_allclose(run.final.u[:, 0], exact[:2], atol=1e-9)
    assert run.energy_error < 1e-9 < abs(run.work[-1])
