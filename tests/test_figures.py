"""The pictures: their numbers make the claims, their files are whole."""

import ast
import multiprocessing
import os
import re
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from figures import (
    FIRST,
    _draw,
    _stored,
    chosen,
    constitutive_rigid,
    derivations_ledger,
    pictures,
    prism_chain,
    prism_drawing,
    wave_supersonic,
)
from figures.__main__ import arguments_of, costs, main, selected, update
from figures._draw import Job
from figures._files import PRINTED, read_printed, read_tables, write_tables
from figures._gallery import made, write_index
from tensegrity import equilibrium_path

pytestmark = pytest.mark.unchanged("docs", "Makefile", ".gitignore")

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def supersonic():
    return wave_supersonic.data()


def numbers(tables):
    return dict(zip(tables["numbers"]["quantity"], tables["numbers"]["value"], strict=True))


def test_wave_at_12_16_sound_speed_nearly_is_the_tent(supersonic):
    found = numbers(supersonic)
    assert found["speed over sound speed"] == pytest.approx(12.16, abs=1e-3)
    assert found["tent - exact, over the peak"] < 0.1
    assert found["emerged - exact, over the peak"] < 1e-5
    assert found["width, emerged [sites]"] < 2.3
    assert 0.9 < found["peak over locking stroke"] < 1


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


def test_the_prisms_of_the_drawn_chain_are_in_equilibrium_under_the_preload():
    tables = prism_chain.data()
    found = numbers(tables)
    at = {"height": found["height under preload"]}
    state = equilibrium_path(prism_chain.PRISM, at=at).events[0]
    assert state.load == pytest.approx(prism_chain.PRELOAD, rel=1e-9)
    assert np.degrees(state.twist) == pytest.approx(found["twist under preload [deg]"], rel=1e-9)
    nodes = np.column_stack(list(tables["nodes"].values()))
    bars = np.linalg.norm(nodes[3:] - nodes[:3], axis=1)
    assert bars == pytest.approx(prism_chain.PRISM.natural_lengths().bar, rel=1e-12)


def test_pictures_are_written_with_their_tables(tmp_path, capsys):
    assert main(["constitutive_rigid", "--output", str(tmp_path)]) == 0
    folder = tmp_path / "constitutive"
    assert (folder / "constitutive_rigid.png").read_bytes().startswith(b"\x89PNG")
    assert {path.suffix for path in folder.iterdir()} == {".png", ".csv"}
    said = capsys.readouterr().out
    assert re.search(r"1/1 +[0-9.]+ s  constitutive/constitutive_rigid: A slender", said)
    assert said.splitlines()[-1].startswith(f"{tmp_path / 'index.html'} shows all")
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
    """It finds all in the cache of a process that computed the numbers."""
    environment, found = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}, []
    data = "from figures import constitutive_rigid; constitutive_rigid.data()"
    name = ["constitutive_rigid", "--output", str(tmp_path)]
    for how in (["-c", data], ["-m", "figures", *name]):
        command = [sys.executable, *how]
        answer = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
        assert answer.returncode == 0, answer.stderr
        kernels = (tmp_path / "tensegrity").glob("**/*.so")
        found.append({path: path.stat().st_ctime_ns for path in kernels})
    assert found[0] == found[1] != {}


def test_the_first_pictures_are_few_of_many_jobs_and_take_two_minutes_at_most():
    assert 12 <= len(FIRST) <= 16
    assert len(set(FIRST)) == len(FIRST)
    groups = {pictures()[name].GROUP for name in FIRST}
    assert {"derivations", "constitutive", "response", "waves", "granular", "packs"} <= groups
    drawn = list(selected(arguments_of().parse_args([])))  # the longest first
    assert sorted(drawn) == sorted(FIRST)
    assert drawn == sorted(drawn, key=costs().get, reverse=True)
    assert sum(costs()[name] for name in FIRST) / 2 < 120
    assert costs()[FIRST[0]] + costs()[FIRST[1]] < 5


def test_all_pictures_have_a_cost_and_the_slow_ones_come_last():
    assert costs().keys() == pictures().keys()
    order = [costs()[name] for name in selected(arguments_of().parse_args(["--all"]))]
    assert order == sorted(order)
    assert sum(order) / 2 < 12 * 60


DOORS = ("tensegrity", "tensegrity.objective", "tensegrity.catalogue", "granular",
         "granular.design", "granular.lammps")  # fmt: skip
INSIDE = {
    "granular.contact_network.wall_sites": "which sites to record for the force on a wall",
    "granular.design.objective": "forces of many designs by the one step of a search",
    "tensegrity.animation.moving": "a moving pack in panels of a picture",
    "tensegrity.check.replacing": "files written beside others that they replace",
    "tensegrity.engine": "the loop itself, its threads, and expressions in CasADi",
    "tensegrity.plotting": "films of tables, which are no runs",
    "tensegrity.prisms.fold_curve.limit_load": "a limit point continued in two parameters",
    "tensegrity.scenes.dynamics.dynamics": "steps beyond the bounds that `simulate` sets",
    "tensegrity.springs.kinks.TAUT": "a tolerance that is explained",
    "tensegrity.waves.transition.standing_forces": "what pins fronts, without looking for one",
}


def test_pictures_are_made_from_the_public_interface():
    """Modules of `derivations` are its interface; what else is not public stands in `INSIDE`."""
    public = {f"{door}.{name}" for door in DOORS for name in import_module(door).__all__}
    needed = set()
    for path in sorted((ROOT / "figures").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            else:
                continue
            for name in names:
                if name.split(".")[0] in ("tensegrity", "granular") and name not in {
                    *DOORS,
                    *public,
                }:
                    inside = [key for key in INSIDE if f"{name}.".startswith(f"{key}.")]
                    assert inside, f"{path.name} imports {name}"
                    needed |= set(inside)
    assert needed == INSIDE.keys()


def test_what_was_stopped_goes_on_where_it_was(tmp_path, capsys):
    """All but one of the first pictures are there, of the same sources."""
    of, last = _stored.everything(), "prism_drawing"
    for name in set(FIRST) - {last}:
        mark = _draw.mark_of(Job(name, tmp_path, of))
        mark.parent.mkdir(exist_ok=True)
        mark.write_text("other sources" if name == "constitutive_rigid" else of)
    assert main(["--output", str(tmp_path), "--processes", "1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    n = len(FIRST)
    assert lines[0] == f"{n - 2} of {n} pictures are there, of the same sources"
    assert [line.split()[0] for line in lines[1:3]] == [f"{n - 1}/{n}", f"{n}/{n}"]
    assert "start/prism_drawing: A triangular prism" in lines[1]
    assert "make gallery" in lines[3]
    assert len(lines) == 4
    assert main(["--output", str(tmp_path)]) == 0
    assert f"{n} of {n} pictures are there" in capsys.readouterr().out


def works(case):
    """What is given back, what fails, what never ends."""
    if case < 0:
        raise ValueError("negative")
    return case if case < 10 else signal.sigwait([signal.SIGUSR1])


def test_pictures_are_drawn_by_processes_and_one_that_fails_stops_no_other():
    found = dict(_draw.finished(works, [1, -1, 2, 3], 2))
    assert isinstance(found.pop(-1), ValueError)
    assert found == {1: 1, 2: 2, 3: 3}


def test_what_stops_drawing_stops_its_processes():
    drawing = _draw.finished(works, [1, 10, 11, 12], 2)
    assert next(drawing) == (1, 1)
    assert multiprocessing.active_children() != []
    drawing.close()
    assert multiprocessing.active_children() == []


def test_nothing_under_version_control_lies_where_pictures_are_drawn():
    assert "figures/output/" in (ROOT / ".gitignore").read_text().splitlines()
    if (ROOT / ".git").exists():
        command = ["git", "ls-files", "figures/output"]
        answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
        assert answer.stdout == ""


def test_only_pictures_that_are_shown_elsewhere_are_refreshed(tmp_path):
    names = ("output", "shown", "data", "made", "kept")
    output, shown, data, made, kept = (tmp_path / name for name in names)
    for folder in (output / "start", shown, data, made):
        folder.mkdir(parents=True)
    (output / "start" / "prism_drawing.csv").write_text("new")
    Image.new("RGB", (9, 9)).save(output / "start" / "prism_drawing.png")
    (shown / "prism_drawing.png").write_text("old")
    (shown / "wave_supersonic.png").write_text("old")
    one = _draw.Drawn("prism_drawing", "start", [], 3.0, 2.04)
    (made / "some.npz").write_text("result")
    update(chosen(["prism_drawing"]), [one], output, shown, data, made, kept)
    assert (data / "some.npz").read_text() == "result"
    new = (output / "start" / "prism_drawing.png").read_bytes()
    assert {path.name: path.read_bytes() for path in shown.iterdir()} == {
        "prism_drawing.png": new,
        "wave_supersonic.png": b"old",
    }
    assert "prism_drawing,2.0" in (data / "seconds.csv").read_text()


@pytest.mark.slow
def test_the_ledger_is_drawn_as_it_is_decided():
    tables = derivations_ledger.data()
    here = {line["quantity"]: line["here"] for line in derivations_ledger.table(tables)}
    count = len(tables["entries"]["name"])
    assert here["verdicts that the derivations confirm"] == count
    assert (
        sum(here[name] for name in ("holds", "holds under a convention", "misprint"))
        + here["a claim without formula"]
        == count
    )
    assert len(tables["misprints"]["printed"]) == here["misprint"] > 0
    for printed, derived in zip(
        tables["misprints"]["printed"], tables["misprints"]["derived"], strict=True
    ):
        assert printed != derived


def test_make_help_names_every_target():
    text = (ROOT / "Makefile").read_text()
    targets = {x for line in re.findall(r"^\.PHONY: (.*)$", text, re.M) for x in line.split()}
    answer = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True)
    assert targets - {"help"} == set(re.findall(r"make ([a-z-]+)", answer.stdout))
