"""Results as data sets of xarray, tables of pandas and CSV files, each number with its unit."""

import gzip
import os
import subprocess
import sys

import numpy as np
import pytest
from networks import patch, pushed
from scenes import lanes, prism_chain, smooth_blow

from tensegrity import (
    Chain,
    Damping,
    Prism,
    Record,
    TensegrityError,
    equilibrium_path,
    plates,
    simulate,
)

ELASTIC = Prism(1.0, 0.7, 0.01, 1.0, k_base=10.0, k_bar=100.0)


def structure_path():
    supports = plates([0, 1, 2], [3, 4, 5])
    return equilibrium_path(ELASTIC.structure(), supports=supports, max_shortening=0.05)


PATHS = {"prism": lambda: equilibrium_path(ELASTIC), "structure": structure_path}


def test_a_run_is_a_data_set_with_units():
    pytest.importorskip("xarray")
    chain = prism_chain(12)
    run = simulate(chain, smooth_blow(chain), 5.0, record=Record(every=2, sites=[3, 1]))
    data = run.to_xarray()
    assert dict(data.sizes) == {"t": len(run.t), "site": 2}
    assert (data.u.sel(site=1).values == run.u[:, 1]).all()
    assert (data.v.values == run.v).all()
    assert data.u.dims == ("t", "site")
    assert data.energy.dims == ("t",)
    units = {name: data[name].attrs["units"] for name in ("t", "u", "v", "energy")}
    assert units == {"t": "s", "u": "m", "v": "m/s", "energy": "J"}
    assert data.attrs["dt"] == run.dt


def test_runs_of_networks_driven_chains_and_batches_have_their_axes():
    pytest.importorskip("xarray")
    scene = patch(3)
    run = simulate(scene, pushed(scene), 1.0, dt=0.01)
    data = run.to_xarray()
    assert data.u.dims == ("t", "site", "axis")
    assert (data.u.sel(axis="y", site=4).values == run.u[:, 4, 1]).all()
    damped = Chain(prism_chain(8).springs[0], 8, damping=Damping(0.1))
    lossy = simulate(damped, smooth_blow(damped), 2.0, dt=0.01)
    kept = lossy.to_xarray()
    balance = (kept.energy - kept.work + kept.loss).values
    assert np.allclose(balance, balance[0], rtol=1e-5)
    ensemble, state = lanes(3)
    many = simulate(ensemble, state, 2.0, dt=0.05)
    assert many.to_xarray().u.dims == ("t", "site", "scene")
    assert (many.to_xarray().energy.isel(scene=2).values == many[2].energy).all()


@pytest.mark.parametrize("name", PATHS)
def test_a_path_is_a_table_of_pandas(name):
    pytest.importorskip("pandas")
    path = PATHS[name]()
    table = path.to_dataframe()
    assert len(table) == len(path)
    assert list(table.columns) == list(path.columns)
    assert (table["load"] == path.load).all()
    assert table.attrs["headings"]["load"] == "load [N]"
    assert table.attrs["end"] == path.end
    assert [event["kind"] for event in table.attrs["events"]] == [e.kind for e in path.events]


@pytest.mark.parametrize("name", PATHS)
def test_a_csv_names_columns_members_and_units_and_reads_back(name, tmp_path):
    path = PATHS[name]()
    path.to_csv(tmp_path / "path.csv")
    header, *rows = (tmp_path / "path.csv").read_text().splitlines()
    headings = header.split(",")
    assert len(headings) == len(set(headings)) == len(path.columns)
    values = np.array([row.split(",") for row in rows], dtype=float)
    assert (values[:, headings.index("load [N]")] == path.load).all()
    assert (values[:, headings.index("shortening [m]")] == path.shortening).all()
    if name == "structure":
        string = int(np.flatnonzero(path.structure.is_string)[0])
        column = headings.index(f"tension of string {string} [N]")
        assert (values[:, column] == path.tensions[:, string]).all()
        assert "tension of bar 0 [N]" in headings


def test_a_csv_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    path, file = PATHS["prism"](), tmp_path / "path.csv"
    path.to_csv(file)
    before = file.read_bytes()

    def full(new, *_, **__):
        with open(new, "w") as begun:
            begun.write("# part of a header")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numpy.savetxt", full)
    with pytest.raises(TensegrityError, match=r"path\.csv cannot be written: No space left"):
        path.to_csv(file)
    assert [*tmp_path.iterdir()] == [file]
    assert file.read_bytes() == before
    monkeypatch.undo()
    link = tmp_path / "link.csv"
    link.symlink_to(file)
    path[:3].to_csv(link)  # what it leads to is replaced, not the link
    assert link.is_symlink()
    assert len(file.read_text().splitlines()) == 4
    packed = tmp_path / "path.csv.gz"
    path.to_csv(packed)
    assert gzip.decompress(packed.read_bytes()) == before


@pytest.mark.skipif(not os.path.islink("/dev/stdout"), reason="no such device")
def test_a_csv_goes_to_what_is_no_file():
    """A device is written, and not replaced."""
    code = (
        "from tensegrity import Prism, equilibrium_path\n"
        "equilibrium_path(Prism(1, 0.7, 0.01, 1)).to_csv('/dev/stdout')"
    )
    there = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    path = equilibrium_path(Prism(1, 0.7, 0.01, 1))
    assert len(there.stdout.splitlines()) == len(path) + 1, there.stderr
    assert os.path.islink("/dev/stdout")


def test_what_is_missing_is_named_with_the_extra_that_has_it(monkeypatch):
    chain = prism_chain(4)
    run = simulate(chain, chain.at_rest(), 1.0, dt=0.1)
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(TensegrityError, match=r"to_xarray needs xarray.*with \[data\]"):
        run.to_xarray()
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(TensegrityError, match=r"to_dataframe needs pandas.*with \[data\]"):
        structure_path().to_dataframe()
