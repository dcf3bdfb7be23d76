"""Files read by large programs, in the extra `readers`: `make readers`."""

import numpy as np
import pytest
from structures import icosahedron

from granular import Bead, Striker, chain, materials
from tensegrity import Record, Structure, TensegrityError, catalogue, files, simulate

SECONDS = 0.5


def test_vtk_reads_members_and_makes_tubes_of_them(tmp_path):
    vtk = pytest.importorskip("vtk")
    from vtk.util.numpy_support import vtk_to_numpy

    shape = icosahedron()
    path = tmp_path / "one.vtp"
    files.write(path, shape)
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    found = reader.GetOutput()
    assert np.array_equal(vtk_to_numpy(found.GetPoints().GetData()), shape.positions)
    lines = vtk_to_numpy(found.GetLines().GetConnectivityArray())
    assert np.array_equal(lines.reshape(-1, 2), shape.ends)
    tensions = vtk_to_numpy(found.GetCellData().GetArray("tension [N]"))
    assert np.array_equal(tensions, shape.tensions)
    tubes = vtk.vtkTubeFilter()
    tubes.SetInputConnection(reader.GetOutputPort())
    tubes.Update()
    assert tubes.GetOutput().GetNumberOfCells() > len(shape.ends)


def test_ase_reads_the_beads_of_a_dump(tmp_path):
    read = pytest.importorskip("ase.io").read
    bead = Bead(10e-3, materials["steel"])
    beads = chain([bead] * 4, striker=Striker(bead, speed=1.0))
    run = simulate(beads, beads.start(), 4e-5, record=Record(interval=1e-5))
    path = tmp_path / "beads.dump"
    files.write(path, run)
    found = read(path, index=":", format="lammps-dump-text", units="si")
    assert len(found) == len(run.t)
    places = np.array([one.positions[:, 0] for one in found]) * 1e-10  # angstroms
    assert places == pytest.approx(run.frames().places[..., 0], abs=1e-15)


def loose(k_bar):
    """Six bars whose strings are not in equilibrium."""
    shape = catalogue.expandable_octahedron(1.0, 0.1)
    natural = np.where(shape.is_string, 0.9 * shape.lengths, shape.lengths)
    natural[[8, 12, 20]] *= 0.9, 0.8, 1.3
    return shape.at(shape.positions, mass=0.02, bar_mass=0.2, natural_lengths=natural,
                    k_string=100.0, k_bar=k_bar)  # fmt: skip


def at_the_end(path):
    """Positions of the nodes after some seconds, in MuJoCo."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    while data.time < SECONDS - 1e-9:
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    count = model.nsite
    return np.array([data.site(f"node{k}").xpos for k in range(count)])


@pytest.mark.slow
def test_mujoco_moves_six_rigid_bars_as_stiff_ones_move(tmp_path):
    """The bars of 1e9 N/m shorten by 1e-8 m: the motion agrees to 5e-8 m after 0.3 m of way."""
    stiff = loose(1e9)
    files.write(tmp_path / "six.xml", stiff, dt=1e-4, gravity=2.0)
    theirs = at_the_end(tmp_path / "six.xml")
    network = stiff.network(gravity=2.0)
    dt = 1.2 / np.sqrt(12 * 1e9 / 0.2)
    given = {"method": "rkn6", "dt": dt, "record": Record(times=[SECONDS])}
    run = simulate(network, network.at_rest(), SECONDS, **given)
    assert np.abs(run.final.u).max() > 0.2
    assert np.abs(theirs - stiff.positions - run.final.u).max() < 5e-8


def test_mujoco_runs_a_cable_over_a_node_that_slides(tmp_path):
    """A weight on a cable between two heavy bars, which do not move, against its ODE."""
    places = [(0, 0, 0), (0, 0, 1), (4, 0, 0), (4, 0, 1), (1.5, 0, -1.8)]
    shape = Structure(places, bars=[(0, 1), (2, 3)], cables=[(0, 4, 2)], mass=[0, 0, 0, 0, 5.0],
                      bar_mass=1e9, EA_string=2000.0, natural_lengths=[1, 1, 4.0])  # fmt: skip
    files.write(tmp_path / "pulley.xml", shape, dt=1e-4)
    found = at_the_end(tmp_path / "pulley.xml")[4]
    from scipy.integrate import solve_ivp

    def rate(_, z):
        arms = np.array([[0, 0, 0], [4, 0, 0]]) - z[:3]
        lengths = np.linalg.norm(arms, axis=1)
        tension = max(0.0, 2000.0 * (lengths.sum() / 4.0 - 1))
        return np.append(z[3:], tension * (arms / lengths[:, None]).sum(axis=0) / 5.0)

    start = np.append(places[4], np.zeros(3))
    way = solve_ivp(rate, (0, SECONDS), start, method="DOP853", rtol=1e-11, atol=1e-12)
    assert np.abs(found - way.y[:3, -1]).max() < 1e-6


def test_what_a_model_does_not_hold_is_refused(tmp_path):
    shape = loose(100.0)
    for made, words in (
        (shape.at(shape.positions, bar_mass=0.0, mass=0.0, string_mass=0.1), "string_mass"),
        (shape.at(shape.positions, buckling=1.0), "buckling"),
    ):
        with pytest.raises(TensegrityError, match=words):
            files.write(tmp_path / "x.xml", made)
