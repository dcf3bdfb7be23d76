"""The pictures: their numbers make the claims, their files are whole."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from figures import chosen, constitutive_rigid, pictures, prism_drawing, wave_supersonic
from figures.__main__ import main
from figures._files import PRINTED, read_printed, read_tables, write_tables
from figures._gallery import made, write_index

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def supersonic():
    return wave_supersonic.data()


def numbers(tables):
    return dict(zip(tables["numbers"]["quantity"], tables["numbers"]["value"], strict=True))


def test_wave_at_12_16_sound_speed_nearly_is_the_tent(supersonic):
    found = numbers(supersonic)
    assert found["speed over sound speed"] == pytest.approx(12.16, abs=1e-3)
    assert found["tent - exact, over the crest"] < 0.1
    assert found["emerged - exact, over the crest"] < 1e-5
    assert found["width, emerged [sites]"] < 2.3
    assert 0.9 < found["crest over locking stroke"] < 1


def test_constitutive_curves_show_locking_and_collapse():
    tables = constitutive_rigid.data()
    locks, flat = tables["h0.7_p0.1"], tables["h0.25_p0.1"]
    assert np.isfinite(locks["locking_height"][0])
    assert locks["load"].max() > 10
    assert np.isnan(flat["locking_height"][0])
    top = int(np.argmax(flat["load"]))
    assert 0 < flat["height"][top] < 0.25  # a limit point on the way to lying flat
    for table in tables.values():
        assert np.isfinite(table["load"]).all()


def test_the_drawn_prism_is_turned_by_150_degrees_and_its_bars_push():
    tables = prism_drawing.data()
    assert numbers(tables)["twist [deg]"] == pytest.approx(150, abs=1e-9)
    assert numbers(tables)["height"] == pytest.approx(prism_drawing.PRISM.height, rel=1e-12)
    kinds, tension = (np.array(tables["members"][name]) for name in ("kind", "tension [N]"))
    assert {name: int((kinds == name).sum()) for name in set(kinds)} == {
        "bars": 3, "cross": 3, "base": 6
    }  # fmt: skip
    assert (tension[kinds == "bars"] < 0).all()
    assert (tension[kinds != "bars"] > 0).all()


def test_pictures_are_written_with_their_tables(tmp_path, capsys):
    assert main(["constitutive_rigid", "--output", str(tmp_path)]) == 0
    folder = tmp_path / "constitutive"
    assert (folder / "constitutive_rigid.png").read_bytes().startswith(b"\x89PNG")
    assert {path.suffix for path in folder.iterdir()} == {".png", ".csv"}
    written = read_tables(folder / "constitutive_rigid.csv")
    computed = constitutive_rigid.data()
    assert set(written) == set(computed)
    load = [float(x) for x in written["h0.7_p0.01"]["load"]]
    np.testing.assert_array_equal(load, computed["h0.7_p0.01"]["load"])
    page = (tmp_path / "index.html").read_text()
    assert 'src="constitutive/constitutive_rigid.png"' in page
    assert 'href="constitutive/constitutive_rigid.csv"' in page
    assert "python -m figures constitutive_rigid" in page


def test_any_tables_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "one.csv"
    tables = {
        "a, b": {"x [m]": [1, 2.5], "word": ["one", 'two "three"', "four"]},
        "c": {"y": [0.1]},
    }
    lines = [{"what": "speed", "here": 2.0}, {"what": "width", "paper": "about 5"}]
    write_tables(path, tables, lines)
    told = {t: {c: list(map(str, v)) for c, v in columns.items()} for t, columns in tables.items()}
    assert read_tables(path, {"a, b", "c"}) == told
    assert read_printed(path) == [
        {"what": "speed", "here": "2.0", "paper": ""},
        {"what": "width", "here": "", "paper": "about 5"},
    ]
    with pytest.raises(ValueError, match="printed"):
        write_tables(path, {PRINTED: {"x": [1]}})
    path.write_text("x,y\n1,2\n")
    with pytest.raises(ValueError, match="does not begin with table,column,row,value"):
        read_tables(path)


def test_the_gallery_shows_what_is_there_and_what_it_printed(tmp_path):
    folder = tmp_path / "waves"
    folder.mkdir()
    (folder / "wave_speeds.png").touch()
    write_tables(folder / "wave_speeds.csv", {}, [{"scene": "<one>", "error": 1 / 3, "sites": 12}])
    assert {g: list(found) for g, found in made(tmp_path).items()} == {"waves": ["wave_speeds"]}
    page = write_index(tmp_path).read_text()
    assert "<td>&lt;one&gt;</td><td>0.333333</td><td>12</td>" in page
    assert "wave_collision" not in page


def test_names_groups_and_mistakes(capsys):
    assert set(chosen(["waves"])) >= {"wave_speeds", "wave_supersonic"}
    assert set(chosen([])) == set(pictures())
    assert main(["--list"]) == 0
    assert "constitutive_rigid" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["no_such_picture"])


def test_the_second_start_compiles_nothing(tmp_path):
    """It finds all in the cache of the first."""
    environment, found = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}, []
    for _ in range(2):
        command = [sys.executable, "-m", "figures", "constitutive_rigid", "--output", str(tmp_path)]
        answer = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
        assert answer.returncode == 0, answer.stderr
        kernels = (tmp_path / "tensegrity").glob("**/*.so")
        found.append({path: path.stat().st_ctime_ns for path in kernels})
    assert found[0] == found[1] != {}
