"""`tensegrity.files`: what is written is read back by other programs, and by `read` to the bit."""

import base64
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from structures import cross, icosahedron

from granular import Bead, Striker, fcc_pack, materials
from tensegrity import (
    Chain,
    Ensemble,
    PowerLaw,
    Record,
    Structure,
    TensegrityError,
    catalogue,
    equilibrium_path,
    files,
    held,
    simulate,
)

SAME = ("positions", "ends", "natural_lengths", "stiffnesses", "EA", "keeps_EA", "mass",
        "member_mass", "is_string")  # fmt: skip
CORNERS = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.1), (1.0, 2.0, 0.2), (0.0, 1.0, 0.3)]


def of_all_kinds():
    """Bars that buckle, strings of given EA, a cable over nodes, and masses of members."""
    return Structure(
        CORNERS, bars=[(0, 2), (1, 3)], strings=[(0, 1), (1, 2)], cables=[(2, 3, 0)],
        k_bar=[50.0, 1 / 3], EA_string=[2.0, 3.0, 0.1], buckling=[1.0, 2.0], bar_mass=[0.1, 0.2],
        string_mass=0.01, mass=[0.0, 0.1, 0.2, 0.3], natural_lengths=[2.0, 1.7, 0.9, 2.1, 2.2],
    )  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def struck():
    """A run of a pack of beads."""
    steel = materials["steel"]
    bead = Bead(10e-3, steel)
    pack = fcc_pack(2, 2, bead=bead, floor=steel, sides=steel, striker=Striker(bead, speed=1.0))
    return simulate(pack, pack.start(), 4e-5, record=Record(interval=1e-5))


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("shape", [icosahedron(), cross(), of_all_kinds()])
def test_a_structure_comes_back_from_its_sheets_to_the_bit(folder, shape, separator):
    files.write("one.csv", shape, separator=separator)
    for name in ("one.csv", "one.nodes.csv", "one.members.csv"):
        again = files.read(name)
        assert all(np.array_equal(getattr(again, x), getattr(shape, x)) for x in SAME)
        assert (again.cables, again.buckling is None) == (shape.cables, shape.buckling is None)
        assert again.buckling is None or np.array_equal(again.buckling, shape.buckling)


@pytest.mark.parametrize("make", [catalogue.x_plate, catalogue.x_strip, catalogue.octahedra])
def test_a_lattice_comes_back_from_its_sheets_to_the_bit(folder, make):
    lattice = make()
    files.write("one.csv", lattice)
    again = files.read("one.csv")
    for name in (*SAME, "vectors", "offsets"):
        assert np.array_equal(getattr(again, name), getattr(lattice, name)), name


GOOD = {
    "nodes": "node;x [mm];y (mm);mass [g]\nA;0;0;1\n1;1000,5;0;2\ntop;0;-2,5e2;3,5\n",
    "members": "kind;from;to;EA [kN];natural length [cm]\nstrut;A;1;2,5;100\ncable;1;top;1e-1;99\n",
}


def given(folder, mark="", **changed):
    """Two sheets, some lines of which are replaced: {(sheet, line): text}."""
    for sheet, text in GOOD.items():
        lines = text.splitlines()
        for place, new in changed.items():
            name, _, line = place.partition("_")
            if name == sheet:
                lines[int(line) - 1 :][:1] = []
                lines[int(line) - 1] = new
        (folder / f"a.{sheet}.csv").write_text(mark + "\n".join(lines), encoding="utf-8")


def test_sheets_have_names_units_decimal_commas_and_a_byte_order_mark(folder):
    given(folder, "\ufeff")
    one = files.read("a.csv")
    assert one.positions.tolist() == [[0, 0], [1.0005, 0], [0, -0.25]]
    assert one.mass == pytest.approx([1e-3, 2e-3, 3.5e-3], rel=1e-15)
    assert one.EA.tolist() == pytest.approx([2500.0, 100.0], rel=1e-15)
    assert one.natural_lengths == pytest.approx([1.0, 0.99], rel=1e-15)
    assert one.ends.tolist() == [[0, 1], [1, 2]]


@pytest.mark.parametrize(
    ("place", "text", "words"),
    [
        ("nodes_1", "node;x [mm];y [m]", r"nodes.csv, line 1, column 3.*another unit than x"),
        ("nodes_1", "node;x [mm];y [N];mass", r"line 1, column 3.*unknown unit"),
        ("nodes_1", "node;x;x;mass", "line 1, column 3: 'x' is there twice"),
        ("nodes_1", "node;x;height;mass", "line 1, column 3: 'height' must be one of node, x, y"),
        ("nodes_1", "node;x;z;mass", "line 1: no column 'y'"),
        ("nodes_3", "A;1;0;1", "line 3, column 'node': 'A' is there twice"),
        ("nodes_3", "1;1.000,5;0;1", "line 3, column 'x': '1.000,5' is no finite number"),
        ("nodes_3", "1;nan;0;1", "line 3, column 'x': 'nan' is no finite number"),
        ("nodes_3", "1;1;0", "line 3: 3 columns, must be 4 as in line 1"),
        ("nodes_3", "1;1;0;-1", "line 3, column 'mass': '-1' must be at least 0"),
        ("members_1", "kind;from;to;EA [N/m];natural length", "line 1, column 4.*unknown unit"),
        ("members_2", "rope;A;1;1;1", r"members.csv, line 2, column 'kind': 'rope' must be one of"),
        ("members_2", "bar;A;2;1;1", "line 2, column 'to': '2' names no node of a.nodes.csv"),
        ("members_2", "bar;A;1;0;1", "line 2, column 'ea': '0' must be above 0"),
        ("members_3", "bar;A;A;1;1", "a.nodes.csv and a.members.csv: bar joins node 0 to itself"),
    ],
)  # fmt: skip
def test_bad_sheets_are_refused_by_file_line_and_column(folder, place, text, words):
    given(folder, **{place: text})
    with pytest.raises(TensegrityError, match=words):
        files.read("a.csv")


def blocks(path):
    """Arrays of a .vtp by their names, read by the standard library."""
    found = {}
    for one in ElementTree.parse(path).iter("DataArray"):
        kind = {"Float64": "<f8", "Int64": "<i8", "UInt8": "u1"}[one.get("type")]
        data = base64.b64decode(one.text[12:])
        assert base64.b64decode(one.text[:12]) == len(data).to_bytes(8, "little")
        columns = int(one.get("NumberOfComponents"))
        found[one.get("Name")] = np.frombuffer(data, kind).reshape(-1, columns).squeeze()
    return found


def test_lines_of_vtk_carry_what_members_carry(folder):
    shape = of_all_kinds()
    files.write("one.vtp", shape)
    found, each = blocks("one.vtp"), shape.cable_segments.each
    assert np.array_equal(found["points"], shape.positions)
    assert np.array_equal(found["connectivity"].reshape(-1, 2), shape.segments)
    assert np.array_equal(found["tension [N]"], each(shape.tensions))
    assert np.array_equal(found["force density [N/m]"], each(shape.densities))
    assert np.array_equal(found["slack"], each(shape.slack))
    flat = cross()
    files.write("one.vtp", flat.modes(2), number=1, row=6)
    moved = blocks("one.vtp")["displacement [m]"]
    assert moved[:, :2] == pytest.approx(0.15 * flat.modes(2).shapes[1], abs=1e-12)
    assert not moved[:, 2].any()


def test_a_list_of_vtk_has_a_file_an_instant(folder, struck):
    two = Structure([[-1, 0], [1, 0], [0, 1]], bars=[(0, 2), (1, 2)])
    path = equilibrium_path(two, supports=held([0, 1]), loads={2: (0.0, -0.1)}, max_load=0.1)
    for thing, along in ((path, path.columns[next(iter(path.columns))]), (struck, struck.t)):
        files.write("all.pvd", thing)
        sets = list(ElementTree.parse("all.pvd").iter("DataSet"))
        assert np.array_equal([float(one.get("timestep")) for one in sets], along)
        found = blocks(sets[-1].get("file"))
        dim = struck.u.shape[2] if thing is struck else 2
        places = struck.scene.positions + struck.u[-1] if thing is struck else path.positions[-1]
        assert np.array_equal(found["points"][:, :dim], places)
    assert found["radius [m]"] == pytest.approx(struck.scene.radius)


def test_lines_of_a_drawing_are_read_by_ezdxf(folder):
    ezdxf = pytest.importorskip("ezdxf")
    shape = icosahedron()
    files.write("one.dxf", shape)
    drawing = ezdxf.readfile("one.dxf")
    assert not drawing.audit().errors
    lines = list(drawing.modelspace())
    assert [line.dxf.layer == "STRINGS" for line in lines] == shape.is_string.tolist()
    ends = [[tuple(line.dxf.start), tuple(line.dxf.end)] for line in lines]
    assert np.array_equal(ends, shape.positions[shape.ends])


def test_tubes_for_printing_are_closed_bodies_of_the_right_volume(folder):
    trimesh = pytest.importorskip("trimesh")
    shape, radius, sides = icosahedron(), 0.02, 12
    files.write("one.stl", shape, radius=radius, sides=sides, scale=10.0)
    mesh = trimesh.load("one.stl")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    parts = mesh.split()
    assert len(parts) == len(shape.ends) + shape.nodes
    polygon, ball = sides / 2 * np.sin(2 * np.pi / sides), 1.5 * radius  # of radius 1
    tubes = polygon * radius**2 * (shape.lengths - ball)
    angle = np.pi * np.arange(sides // 2 + 1) / (sides // 2)
    height, wide = -ball * np.cos(angle), ball * np.sin(angle)
    cones = np.diff(height) * (wide[1:] ** 2 + wide[1:] * wide[:-1] + wide[:-1] ** 2) / 3
    whole = tubes.sum() + shape.nodes * polygon * cones.sum()
    assert mesh.volume == pytest.approx(1e3 * whole, rel=1e-6)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"radius": 0.0}, "above 0 m"),
        ({"radius": [0.1, 0.1]}, "or 6 of them"),
        ({"radius": 0.4}, "member 2 has length 1 m, must be above two joints, 1.2 m"),
        ({"radius": 0.1, "joint": 0.11}, "joint 0.11 m must be above 1.2 radii"),
        ({}, "needs radius="),
        ({"radius": 0.1, "colour": 1}, "unknown option colour, known are joint, radius, row"),
    ],
)
def test_what_cannot_be_printed_is_refused_and_leaves_the_file(folder, given, words):
    Path("one.stl").write_text("as it was")
    with pytest.raises(TensegrityError, match=words):
        files.write("one.stl", cross(), **given)
    assert [path.read_text() for path in folder.iterdir()] == ["as it was"]


def test_a_surface_that_is_open_in_single_precision_is_refused(folder):
    far = cross(3).at(cross(3).positions + 1e7)
    with pytest.raises(TensegrityError, match=r"one\.stl: the surfaces are not closed"):
        files.write("one.stl", far, radius=0.01)
    twice = Structure([(0, 0), (1, 0)], bars=[(0, 1), (0, 1)])
    with pytest.raises(TensegrityError, match="not closed"):
        files.write("one.stl", twice, radius=0.01)


def test_beads_are_dumped_with_radii_and_the_forces_between_them(folder, struck):
    files.write("beads.dump", struck)
    sites, lines = struck.scene.sites, Path("beads.dump").read_text().splitlines()
    assert lines[2] == "ITEM: TIME"
    assert [float(lines[k * (sites + 11) + 3]) for k in range(len(struck.t))] == struck.t.tolist()
    last = np.loadtxt(lines[-sites:])
    assert np.array_equal(last[:, 2:5], struck.scene.positions + struck.u[-1])
    assert np.array_equal(last[:, 5:8], struck.v[-1])
    assert np.array_equal(last[:, 8], struck.scene.radius)
    forces, tail = np.zeros(struck.u[0].shape), Path("beads.contacts.dump").read_text()
    pairs = np.loadtxt(tail.rpartition("force\n")[2].splitlines())
    for i, j, tension in pairs:
        d = last[int(j) - 1, 2:5] - last[int(i) - 1, 2:5]
        forces[int(i) - 1] += tension * d / np.linalg.norm(d)
        forces[int(j) - 1] -= tension * d / np.linalg.norm(d)
    listed = struck.scene.listed(struck.u)
    free = ~np.isin(np.arange(sites), listed.wall_contacts[:, 0])
    own = listed.forces(struck.u[-1])
    assert forces[free] == pytest.approx(own[free], abs=1e-9 * abs(own).max())


def test_a_run_is_a_table_of_pandas_and_a_file(folder):
    pandas = pytest.importorskip("pandas")
    chain = Chain(PowerLaw(1.0, 1.5, preload=0.1), 6)
    run = simulate(chain, chain.at_rest({0: 0.1}), 3.0, record=Record(interval=0.1))
    run.to_csv("run.csv", "v", sites=[4, 1], times=[0.0, 1.23, 2.96])
    read = pandas.read_csv("run.csv")
    assert [*read.columns] == ["t [s]", "v 4 [m/s]", "v 1 [m/s]"]
    assert np.array_equal(read.to_numpy()[:, 1:], run.v[[0, 12, 30]][:, [4, 1]])
    frame = run.to_dataframe("tension")
    assert np.array_equal(frame["tension 3"], chain.bond_tension(run.u)[:, 3])
    assert frame.attrs["headings"]["tension 3"] == "tension 3 [N]"
    files.write("run.csv", run, quantity="energy")
    assert np.array_equal(pandas.read_csv("run.csv")["energy [J]"], run.energy)
    files.write("run.npz", run)
    assert np.array_equal(files.read("run.npz").u, run.u)


def test_what_a_run_has_not_is_refused(folder, struck):
    for given, words in (
        (("w",), "quantity 'w' must be one of u, v, energy"),
        (("u", [99]), "site 99 is none of"),
        (("u", None, [1.0]), "time 1 s is outside the run, from 0 to 4e-05 s"),
        (("energy", [0]), "sites of the total energy"),
    ):
        with pytest.raises(TensegrityError, match=words):
            struck.to_csv("x.csv", *given)
    chain = Chain(PowerLaw(1.0, 1.5), 4)
    both = Ensemble([chain, chain])
    run = simulate(both, both.at_rest({0: 0.1}), 1.0, dt=0.1)
    with pytest.raises(TensegrityError, match="a batch has no table"):
        run.to_csv("x.csv")


def test_what_a_format_does_not_hold_is_refused(folder, struck):
    for path, thing, words in (
        ("x.obj", cross(), "suffix '.obj' must be one of .csv, .vtp, .pvd"),
        ("x.vtp", struck, "5 instants, a .vtp shows one: give row="),
        ("x.vtp", PowerLaw(1.0, 1.5), "has no frames"),
        ("x.csv", 1.0, "thing 1.0 is not a Table"),
        ("x.npz", cross(), "is not a Run"),
    ):  # fmt: skip
        with pytest.raises(TensegrityError, match=words):
            files.write(path, thing)
    Path("y.members.csv").write_text("kind,from,to\n")
    for path, words in (("x.csv", "x.csv cannot be read"), ("y.csv", "y.nodes.csv cannot be read")):
        with pytest.raises(TensegrityError, match=words):
            files.read(path)


def test_what_is_no_structure_and_no_run_is_a_record(folder, struck):
    struck.to_csv("run.csv", "u", sites=[3])
    found = files.read("run.csv", channel="u 3 z")
    assert np.array_equal(found.values, struck.u[:, 3, 2])
    assert np.array_equal(found.t, struck.t)
    assert found.unit == "m"
    np.savez("record.npz", t=struck.t, force=struck.energy)
    assert np.array_equal(files.read("record.npz").values, struck.energy)
    files.write("beads.dump", struck)
    along = files.read("beads.dump", channel=(4, "vz"))
    assert np.array_equal(along.values, struck.v[:, 3, 2])
