"""The pictures: their numbers make the claims, their files are whole."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from figures import chosen, constitutive_rigid, pictures, wave_supersonic
from figures.__main__ import main

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def supersonic():
    return wave_supersonic.data()


def numbers(tables):
    return dict(zip(tables["numbers"]["quantity"], tables["numbers"]["value"], strict=True))


@pytest.mark.needs_compiler  # minutes without
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


def test_pictures_are_written_with_their_tables(tmp_path, capsys):
    assert main(["constitutive_rigid", "--output", str(tmp_path)]) == 0
    assert (tmp_path / "constitutive_rigid.png").read_bytes().startswith(b"\x89PNG")
    with open(tmp_path / "constitutive_rigid_h0.7_p0.1.csv") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["height"]) > 0
    assert len(rows) > 400
    assert not list(tmp_path.glob("tmp*"))


def test_names_groups_and_mistakes(capsys):
    assert set(chosen(["waves"])) >= {"wave_speeds", "wave_supersonic"}
    assert set(chosen([])) == set(pictures())
    assert main(["--list"]) == 0
    assert "constitutive_rigid" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["no_such_picture"])


@pytest.mark.needs_compiler
def test_the_second_start_compiles_nothing(tmp_path):
    """With the kernels of the first in the cache, a start that may not build succeeds."""
    code = (
        "import sys; from tensegrity.engine import native; from figures.__main__ import main\n"
        "if sys.argv[1] == 'second': native.build = None\n"
        "main(['constitutive_rigid', '--output', sys.argv[2]])"
    )
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    for start in ("first", "second"):
        command = [sys.executable, "-c", code, start, str(tmp_path)]
        answer = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
        assert answer.returncode == 0, answer.stderr
        assert "virtual machine" not in answer.stderr
