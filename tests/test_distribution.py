"""What is handed out: a source archive and a wheel that pass the checks and run elsewhere."""

import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
LEFT_OUT = shutil.ignore_patterns(
    ".*", "build", "dist", "*.egg-info", "__pycache__", "output", "*.new"
)


def test_all_is_what_a_user_may_want():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    (wanted,) = extras["all"]
    names = wanted.removeprefix("tensegrity[").removesuffix("]").split(",")
    assert set(names) <= set(extras) - {"all", "test", "bench", "bench-lammps", "mpi"}
    for name in ("cc", "dask"):
        assert name in names


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Archive and wheel, made from a copy of the source."""
    if not find_spec("build"):
        pytest.skip("the package build is not installed")
    folder = tmp_path_factory.mktemp("made")
    source = folder / "source"
    shutil.copytree(ROOT, source, ignore=LEFT_OUT)
    command = [sys.executable, "-m", "build", "--outdir", str(folder / "dist"), str(source)]
    subprocess.run(command, check=True, timeout=600, capture_output=True)
    (archive,) = (folder / "dist").glob("*.tar.gz")
    (wheel,) = (folder / "dist").glob("*.whl")
    return archive, wheel


@pytest.mark.slow
def test_archive_and_wheel_pass_the_checks(made):
    if not find_spec("twine"):
        pytest.skip("the package twine is not installed")
    command = [sys.executable, "-m", "twine", "--no-color", "check", "--strict", *map(str, made)]
    answer = subprocess.run(command, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stdout
    assert answer.stdout.count("PASSED") == 2


@pytest.mark.slow
def test_archive_holds_what_make_test_needs(made):
    with tarfile.open(made[0]) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    endings = (".py", ".c", ".h", ".js", ".css", ".html", ".json", ".typed", ".toml", ".md", ".cff")
    wanted = set()
    for folder, folders, files in os.walk(ROOT):
        ignored = LEFT_OUT(folder, folders + files)
        folders[:] = [name for name in folders if name not in ignored]
        here = Path(folder).relative_to(ROOT)
        wanted |= {(here / name).as_posix() for name in files
                   if name not in ignored and name.endswith(endings)}  # fmt: skip
    assert {"tests/conftest.py", "figures/__main__.py", "docs/live/live.c"} <= wanted
    assert wanted - held == set()
    assert {"Makefile", "LICENSE"} <= held
    assert not [name for name in held if name.endswith((".pyc", ".so"))]


@pytest.mark.slow
def test_wheel_runs_its_self_test_away_from_the_source(made, tmp_path):
    place = tmp_path / "place"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(place)]
    subprocess.run([*pip, str(made[1])], check=True, timeout=300)
    environment = os.environ | {"PYTHONPATH": str(place)}
    command = [sys.executable, "-P", "-m", "tensegrity"]
    answer = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
    where = [sys.executable, "-P", "-c", "import tensegrity; print(tensegrity.__file__)"]
    said = subprocess.run(where, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert Path(said.stdout.strip()).is_relative_to(place)
