"""What is handed out: a source archive and a wheel that pass the checks and run elsewhere."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

from tensegrity import __version__

pytestmark = pytest.mark.unchanged(
    "benchmarks", "docs", "tests", ".ci", ".github", ".readthedocs.yaml", "CHANGELOG.md", "LICENSE",
    "CITATION.cff", "CONTRIBUTING.md", "MANIFEST.in", "Makefile", "README.md", "pyproject.toml",
)  # fmt: skip

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
HOSTS = (*sorted(ROOT.glob(".github/workflows/*.yml")), ROOT / ".readthedocs.yaml")
LEFT_OUT = shutil.ignore_patterns(
    ".*", "build", "dist", "*.egg-info", "__pycache__", "output", "*.new"
)


def test_all_is_what_a_user_may_want():
    extras = PROJECT["optional-dependencies"]
    assert extras["all"] == [f"{PROJECT['name']}[cc,dask,data,prove,matrix]"]
    assert {"cc", "dask", "data"} <= set(extras)


def test_version_is_that_of_the_package():
    assert PROJECT["dynamic"] == ["version"]
    assert f"\nversion: {__version__}\n" in (ROOT / "CITATION.cff").read_text()
    head = next(x for x in (ROOT / "CHANGELOG.md").read_text().splitlines() if x[:3] == "## ")
    assert head.split()[1] == __version__


def test_addresses_stand_in_one_place():
    folders = ("benchmarks", "derivations", "docs", "figures", "granular", "tensegrity", "tests")
    found = [p for name in (*folders, ".github") for p in (ROOT / name).rglob("*.*")]
    written = [p for p in found if p.suffix in (".py", ".c", ".md", ".toml", ".yml", ".html")]
    written += [*ROOT.glob("*.md"), ROOT / "CITATION.cff", ROOT / "Makefile", *HOSTS]
    domain = PROJECT["urls"]["Homepage"].partition("//")[2]
    assert all(domain in address for address in PROJECT["urls"].values())
    assert [str(path) for path in written if domain in path.read_text(errors="replace")] == []


def test_commands_of_hosts_are_those_of_the_makefile():
    makefile = (ROOT / "Makefile").read_text()
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.M)) | {".venv/ready"}
    extras = {f".venv/with-{name}" for name in PROJECT["optional-dependencies"]}
    texts = [makefile, *(p.read_text() for p in (*HOSTS, *ROOT.glob(".ci/run")))]
    assert set(re.findall(r"\.venv/with-[a-z-]+", "\n".join(texts))) <= extras
    assert len(HOSTS) == 3
    for path in HOSTS:
        called = re.findall(r"make ((?:[a-z./-]+ )+)PYTHON=python\n", path.read_text())
        assert called, path
        assert set(" ".join(called).split()) <= targets | extras, path


def test_workflow_covers_the_pythons_and_systems_that_are_named():
    text = (ROOT / ".github/workflows/tests.yml").read_text()
    known = re.findall(r":: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    assert re.findall(r'"(3\.\d+)"', re.search(r"python: \[(.*)\]", text)[1]) == known
    assert re.search(r"os: \[(.*)\]", text)[1] == "ubuntu-latest, ubuntu-24.04-arm, macos-latest"


@pytest.mark.parametrize("path", HOSTS, ids=lambda path: path.name)
def test_files_of_hosts_are_valid(path):
    yaml = pytest.importorskip("yaml", reason="no YAML reader: the extras dask and site bring one")
    found = yaml.safe_load(path.read_text())
    if path.name == ".readthedocs.yaml":
        assert found["version"] == 2
        assert {"os", "tools", "commands"} == set(found["build"])
        return
    assert {"name", "permissions", "jobs", True} <= set(found)  # `on` is read as True
    for job in found["jobs"].values():
        assert "runs-on" in job
        for step in job["steps"]:
            assert ("uses" in step) != ("run" in step)


@pytest.mark.parametrize("path", [*ROOT.glob(".github/ISSUE_TEMPLATE/*.md")], ids=lambda p: p.name)
def test_issue_templates_have_their_head(path):
    _, head, text = path.read_text().split("---\n")
    assert [line.partition(":")[0] for line in head.splitlines()] == ["name", "about", "labels"]
    assert text.count("```") % 2 == 0


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


def test_archive_and_wheel_pass_the_checks(made):
    if not find_spec("twine"):
        pytest.skip("the package twine is not installed")
    command = [sys.executable, "-m", "twine", "--no-color", "check", "--strict", *map(str, made)]
    answer = subprocess.run(command, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stdout
    assert answer.stdout.count("PASSED") == 2


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
