"""Units are what the user said, in prints, plots, files and messages; numbers are not converted."""

import threading

import matplotlib.pyplot as plt
import pytest

import tensegrity as ts
from tensegrity.unit_names import in_units, unit_text

PRISM = ts.Prism(base=85.0, height=60.0, prestrain=0.1, k_cross=3.0, k_base=5.0, k_bar=50.0)
MILLIMETRES = {"length": "mm", "time": "ms"}


@pytest.mark.parametrize(
    ("si", "said", "none"),
    [
        ("m", "mm", ""),
        ("N/m", "N/mm", ""),
        ("N/m^2", "N/mm^2", ""),
        ("kg/m3", "N ms^2/mm/mm3", ""),
        ("m/s", "mm/ms", ""),
        ("sites/s", "sites/ms", "sites"),
        ("rad/s", "rad/ms", "rad"),
        ("1/s", "1/ms", ""),
        ("J", "N mm", ""),
        ("N m", "N mm", ""),
        ("N s", "N ms", ""),
        ("sites", "sites", "sites"),
    ],
)
def test_a_unit_by_its_names(si, said, none):
    assert unit_text(si) == si
    for names, unit in (
        (MILLIMETRES, said),
        (dict.fromkeys(("length", "force", "time"), ""), none),
    ):
        with ts.units(**names):
            assert unit_text(si) == unit
            behind = f" {unit}" if unit else ""
            assert in_units(f"x 1.5 {si}, y") == f"x 1.5{behind}, y"
            assert in_units(f"x [{si}], y") == (f"x [{unit}], y" if unit else "x, y")
    assert in_units(f"x [{si}]") == f"x [{si}]"


def test_prints_plots_files_and_messages_say_the_units_of_the_user(tmp_path):
    path = ts.equilibrium_path(PRISM, min_height=58.0)
    chain = ts.Chain(PRISM.potential(), sites=4)
    run = ts.simulate(chain, chain.at_rest({0: 0.1}), 5.0, dt=0.1)
    words = "prism of 3 sides: base 85 mm, height 60 mm, prestrain 0.1, k_cross 3 N/mm"
    with ts.units(**MILLIMETRES):
        assert words in str(path)
        assert "load 0 N to height 58 mm" in " ".join(str(path).split())
        assert "dt = 0.1 ms, 50 steps to t = 5 ms" in str(run)
        assert str(run).endswith(" s")  # of wall time
        ax = path.plot()
        assert (ax.get_xlabel(), ax.get_ylabel()) == (
            "shortening [mm]", "load [N], compression > 0"
        )  # fmt: skip
        assert run.plot().get_ylabel() == "time [ms]"
        path.to_csv(tmp_path / "path.csv")
        head = (tmp_path / "path.csv").read_text().splitlines()[0]
        assert "height [mm]" in head
        assert "[m]" not in head
        with pytest.raises(ts.TensegrityError, match="base -1 mm must be"):
            ts.Prism(-1.0, 0.7, 0.01, 1.0)
        xarray = pytest.importorskip("xarray")
        data = run.to_xarray()
        assert isinstance(data, xarray.Dataset)
        assert {name: row.attrs["units"] for name, row in data.data_vars.items()} == {
            "u": "mm", "v": "mm/ms", "energy": "N mm",
        }  # fmt: skip
        assert data.t.attrs["units"] == "ms"
    assert "[m]" in path.plot().get_xlabel()
    assert "base 85 m," in str(path)
    plt.close("all")


def test_units_hold_from_the_call_on_until_others_are_named():
    ts.units(length="in", force="lbf")
    try:
        assert in_units("3 N/m, 2 J") == "3 lbf/in, 2 lbf in"
        with ts.units(length="ft"):
            assert in_units("3 m") == "3 ft"
        assert in_units("3 m") == "3 in"
    finally:
        ts.units()
    assert in_units("3 N/m, 2 J, 1 kg") == "3 N/m, 2 J, 1 kg"
    with pytest.raises(ts.TensegrityError, match="length 1"):
        ts.units(length=1)


def test_each_thread_has_its_units():
    said = []
    with ts.units(length="mm"):
        thread = threading.Thread(target=lambda: said.append(in_units("3 m")))
        thread.start()
        thread.join()
        assert in_units("3 m") == "3 mm"
    assert said == ["3 m"]


def test_units_that_end_in_another_order_leave_none_behind():
    first, second = ts.units(length="mm"), ts.units(length="ft")
    first.close()
    assert in_units("3 m") == "3 ft"
    second.close()
    assert in_units("3 m") == "3 m"


def test_what_a_user_wrote_keeps_its_words():
    with ts.units(length="mm", force="kN"):
        with pytest.raises(ts.TensegrityError, match="'3 N'"):
            ts.Force(1.0, on="3 N")
        said = in_units("the beads' length of 3 m and a file '2 m [N].csv' of Hertz's 4 N")
        assert said == "the beads' length of 3 mm and a file '2 m [N].csv' of Hertz's 4 kN"
