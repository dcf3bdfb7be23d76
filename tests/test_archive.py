"""Runs in files: what comes back is what was saved, and nothing in a file is believed blindly."""

import json
import math
import subprocess
import sys
from dataclasses import MISSING, fields

import numpy as np
import pytest
from crafted import crafted, written
from networks import fork, patch, pushed
from test_resume import elastic, guide, lanes, struck, toda

from granular import Bead, Striker, diamond_guide, materials, power, y_guide
from tensegrity import (
    Chain,
    Network,
    Polynomial,
    PowerLaw,
    Prism,
    Record,
    Run,
    State,
    TensegrityError,
    Wall,
    simulate,
)


def blow():
    loaded = Prism(1.0, 0.7, 0.01, 1.0).potential(preload=0.01)
    flat = Prism(1.0, 0.25, 0.1, 1.0).potential()
    one = Chain([loaded] * 5 + [flat] * 6, 12, ends=("fixed", "free"))
    return one, one.at_rest({3: 0.02})


def walls():
    network = fork()
    v = np.zeros(network.shape)
    v[0, 0] = 0.5
    return network, State(np.zeros(network.shape), v)


def space():
    """Given lengths, loads, a held site, a slanting wall, three dimensions."""
    x = np.array([[0, 0, 0.5], [1, 0.1, 0.5], [0.2, 1, 0.6]])
    wall = Wall([0, 0, 0], [0.1, 0.2, 3.0])
    network = Network(
        x, [(0, 1), (1, 2)], [PowerLaw(1.0, 1.5, 0.2), PowerLaw(2.0, 2.0, 0.1)], [1.01, 1.2],
        mass=[1, 2, 3], walls=[wall], wall_contacts=[(0, 0)], wall_spring=PowerLaw(3.0, 1.5),
        radius=0.4, loads=np.full((3, 3), 1e-3), held=[2],
    )  # fmt: skip
    return network, network.at_rest({0: (0.0, 0.0, -0.1)})


def diamond():
    steel = Bead(4.76e-3, materials["steel"])
    scene = diamond_guide(4, 5, bead=steel, striker=Striker(steel, 0.5), law=power(2e9, 1.4))
    return scene, scene.start()


def loaded():
    """Its equilibrium is that of the guide without the striker."""
    steel = Bead(4.76e-3, materials["steel"])
    scene = y_guide(
        3, 4, bead=steel, striker=Striker(steel, 0.5), end=materials["ptfe"], gravity=9.81,
        law=power(2e9, 1.4),
    )  # fmt: skip
    return scene, scene.start()


def tower():
    """A prism in all coordinates: strings that pull only, bars; one string is slack."""
    prism = Prism(1.0, 0.7, 0.05, 1.0, 10.0, 100.0)
    scene = prism.column(2).network()
    return scene, scene.at_rest({8: (0.0, 0.0, -0.05)})


def fitted():
    chain, state = elastic()
    kinds = {spring: Polynomial(spring, -0.1, 0.05, 1e-8) for spring in set(chain.springs)}
    return Chain([kinds[spring] for spring in chain.springs], 12, chain.mass), state


SCENES = {
    "rigid prisms": (blow, 3.0),
    "elastic prisms, power laws, masses": (elastic, 3.0),
    "lanes": (lanes, 2.0),
    "network": (lambda: (patch(), pushed(patch())), 2.0),
    "walls": (walls, 2e-5),
    "space": (space, 0.3),
    "beads": (struck, 3e-5),
    "guide": (guide, 3e-5),
    "diamond": (diamond, 3e-5),
    "loaded guide": (loaded, 3e-5),
    "structure": (tower, 1.0),
    "polynomials": (fitted, 2.0),
}


def equal(one, two):
    for name in (f.name for f in fields(Run) if f.name not in ("scene", "final")):
        a, b = getattr(one, name), getattr(two, name)
        assert np.array_equal(a, b), name
        assert isinstance(a, type(b)), name
    assert np.array_equal(one.final.u, two.final.u)
    assert np.array_equal(one.final.v, two.final.v)
    assert str(one) == str(two)


@pytest.mark.parametrize("name", SCENES)
def test_a_run_comes_back_with_a_scene_that_runs_to_the_same_bits(tmp_path, name):
    make, t_end = SCENES[name]
    scene, state = make()
    run = simulate(scene, state, t_end, dt=t_end / 40, record=Record(every=5, sites=[1, 0]))
    run.save(tmp_path / "run")
    back = Run.load(tmp_path / "run")
    equal(run, back)
    assert type(back.scene) is type(scene)
    assert repr(back.scene) == repr(scene)
    assert back.scene == scene
    assert back.scene == scene
    again = simulate(back.scene, state, t_end, dt=t_end / 40)
    assert np.array_equal(again.final.u, run.final.u)
    assert np.array_equal(again.final.v, run.final.v)
    if name != "lanes":
        assert back.scene.energy(run.final) == run.energy[-1]


def test_a_run_with_polynomials_and_rows_in_a_file_comes_back(tmp_path):
    soft = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(0.05)
    scene, record = Chain(soft, 600), Record(path=tmp_path / "rows.npy")
    run = simulate(scene, scene.at_rest({0: 0.1}), 40.0, tol=1e-7, record=record)
    assert run.force_model.startswith("polynomial")
    run.save(tmp_path / "run.npz")
    equal(run, Run.load(str(tmp_path / "run.npz")))


def test_a_users_own_energy_leaves_its_print_out(tmp_path):
    scene = toda()
    run = simulate(scene, scene.at_rest({0: 0.5}), 2.0, dt=0.1)
    path = tmp_path / "run.npz"
    run.save(path)
    back = Run.load(path)
    equal(run, back)
    assert repr(back.scene) == repr(scene)
    assert not hasattr(back.scene, "energy")
    with pytest.raises(TensegrityError, match=r"sites of the scene Chain\(12 sites.*again"):
        back.plot()
    with pytest.raises(TensegrityError, match="not a scene"):
        simulate(back.scene, run.final, 1.0)
    back.save(path)
    assert repr(Run.load(path).scene) == repr(scene)


def test_nothing_in_a_file_is_unpickled_or_evaluated(tmp_path):
    """A text in the place of a number stays a text, which constructors refuse."""
    scene, state = blow()
    path = tmp_path / "run.npz"
    simulate(scene, state, 1.0, dt=0.1).save(path)
    with np.load(path, allow_pickle=False) as kept:
        arrays = dict(kept)
    assert all(array.dtype.kind in "fiubU" for array in arrays.values())
    whole = json.loads(str(arrays.pop("text")))
    number = next(n for n, (_, name, _) in enumerate(whole["objects"]) if name == "Chain")
    for parts in (
        {"sites": "__import__('os').mkdir('made')"},
        {"mass": "exp(1)"},
        {"ends": ["open", "free"]},
        {"sites": 13},
        {"more": 1},
    ):
        changed = json.loads(json.dumps(whole))
        changed["objects"][number][2] |= parts
        with open(path, "wb") as file:
            np.savez(file, text=np.array(json.dumps(changed)), **arrays)
        with pytest.raises(TensegrityError, match="holds no run, or is damaged"):
            Run.load(path)
    changed = json.loads(json.dumps(whole))
    changed["objects"][number][1] = "Popen"
    with open(path, "wb") as file:
        np.savez(file, text=np.array(json.dumps(changed)), **arrays)
    with pytest.raises(TensegrityError, match=r"class Popen is not registered: .* version that"):
        Run.load(path)


def test_damaged_and_foreign_files_are_refused(tmp_path):
    scene, state = blow()
    path, bad = tmp_path / "run.npz", tmp_path / "bad.npz"
    run = simulate(scene, state, 1.0, dt=0.1)
    run.save(path)
    whole = path.read_bytes()
    rng = np.random.default_rng(4)
    for place in [*rng.integers(0, len(whole), 150).tolist(), *range(0, 60, 3)]:
        damaged = bytearray(whole)
        damaged[place] ^= 0xFF
        bad.write_bytes(damaged)
        try:
            back = Run.load(bad)
        except TensegrityError:
            continue
        equal(run, back)  # a byte that means nothing, such as a date
    for content in (b"", b"precious", whole[:1000], whole[1000:]):
        bad.write_bytes(content)
        with pytest.raises(TensegrityError, match="holds no run, or is damaged"):
            Run.load(bad)
    np.savez(bad, a=np.arange(3))
    with pytest.raises(TensegrityError, match="holds no run"):
        Run.load(bad)
    written(bad, "state", {"done": 3})
    with pytest.raises(TensegrityError, match="it holds a state"):
        Run.load(bad)
    with pytest.raises(TensegrityError, match="no file"):
        Run.load(tmp_path / "nothing")
    for wrong in (3, None):
        with pytest.raises(TensegrityError, match="is not a path"):
            Run.load(wrong)
        with pytest.raises(TensegrityError, match="is not a path"):
            run.save(wrong)


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    scene, state = blow()
    path = tmp_path / "run.npz"
    run = simulate(scene, state, 1.0, dt=0.1)
    run.save(path)
    before = path.read_bytes()

    def full(number):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(TensegrityError, match=r"run\.npz cannot be written: No space left"):
        run.save(path)
    assert path.read_bytes() == before
    assert [x.name for x in tmp_path.iterdir()] == ["run.npz"]
    with pytest.raises(TensegrityError, match=r"no folder/run\.npz cannot be written"):
        run.save(tmp_path / "no folder" / "run.npz")


def test_a_scene_of_beads_needs_its_package(tmp_path):
    scene, state = struck()
    path = tmp_path / "run.npz"
    simulate(scene, state, 1e-5, dt=1e-6).save(path)
    code = "import sys\nfrom tensegrity import Run\nRun.load(sys.argv[1])"
    for first, words in (("", "import granular first"), ("import granular\n", "")):
        answer = subprocess.run(
            [sys.executable, "-c", first + code, str(path)], capture_output=True, text=True,
        )  # fmt: skip
        assert words in answer.stderr
        assert (answer.returncode == 0) == (not words), answer.stderr


def back(scene, path):
    """The scene of a run that was saved."""
    simulate(scene, scene.at_rest(), 0.0).save(path)
    return Run.load(path).scene


def test_every_potential_of_the_toolkit_is_told_from_others(tmp_path):
    """What the file of a potential holds is enough to make an equal one."""
    rigid = Prism(1.0, 0.7, 0.01, 1.0).potential(0.02)
    square = Prism(1.0, 0.7, 0.01, 1.0, sides=4).potential()
    springs = (rigid, square, PowerLaw(1.0, 1.5, 0.3, 0.1), elastic()[0].springs[0],
               Polynomial(rigid, -0.02, 0.01), *tower()[0].springs[5:7])  # fmt: skip
    for spring in springs:
        (again,) = back(Chain(spring, 2), tmp_path / "run.npz").springs
        assert again == spring
        assert type(again) is type(spring)
        assert repr(again) == repr(spring)
        assert again.values.tobytes() == spring.values.tobytes()
        assert [x == spring for x in springs].count(True) == 1
        if math.isinf(spring.domain[0]):
            continue
        said = []
        for one in (spring, again):
            with pytest.raises(TensegrityError) as caught:
                one.tension(-5.0 if spring.domain[0] > -5 else np.nan)
            said.append(str(caught.value))
        assert said[0] == said[1]


def test_a_wall_comes_back_to_the_bit(tmp_path):
    """Also where the length of its unit normal is not 1 to the last bit."""
    rng = np.random.default_rng(5)
    walls = [Wall([0.0, -9.0 * abs(y)], [x, abs(y)]) for x, y in rng.normal(size=(40, 2))]
    assert any((wall.normal / np.linalg.norm(wall.normal) != wall.normal).any() for wall in walls)
    scene = Network([[0.0, 9.0]], (), PowerLaw(1.0, 1.5), walls=walls, radius=1e-3)
    for again, wall in zip(back(scene, tmp_path / "run.npz").walls, walls, strict=True):
        assert np.array_equal(again.normal, wall.normal)


@pytest.mark.parametrize("name", ["rigid prisms", "lanes", "walls", "guide"])
def test_a_run_whose_parts_do_not_fit_is_refused(tmp_path, name):
    make, t_end = SCENES[name]
    scene, state = make()
    run = simulate(scene, state, t_end, dt=t_end / 40, record=Record(every=5, sites=[1, 0]))
    path = tmp_path / "run.npz"
    run.save(path)
    others = {"t": [-run.t, run.t[::-1]], "steps": [-1, 0.5], "sites": [(0,), ()], "dt": [np.nan]}
    optional = {x.name for x in fields(Run) if x.default is not MISSING}
    for part, value in crafted(path, "run", others):
        if isinstance(value, str) and value == "left out" and part in optional:
            continue
        with pytest.raises(TensegrityError, match="holds no run, or is damaged"):
            print(part, value, Run.load(path))
    equal(run, Run.load(path))


def test_a_network_with_the_contacts_that_a_run_listed_is_stored_as_it_is(tmp_path):
    """Its contacts are fixed: it does not press its walls alone."""
    law = PowerLaw(1e6, 1.5)
    scene = Network(
        [[0.0, 0.011], [0.0205, 0.011], [0.0, 0.5]], np.zeros((0, 2), dtype=int), law, mass=0.01,
        radius=0.01, walls=[Wall([0, 0], [0, 1])], contacts="follow", law=law,
    )  # fmt: skip
    listed = scene.listed(np.zeros((3, 2)))
    assert (len(listed.bonds), len(listed.wall_contacts)) == (1, 2)
    simulate(listed, listed.at_rest({0: [1.0, 0.0]}), 1e-5, dt=1e-6).save(tmp_path / "run")
    back = Run.load(tmp_path / "run").scene
    assert np.array_equal(back.wall_contacts, listed.wall_contacts)
