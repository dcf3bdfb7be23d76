"""Pages of the site that are made: complete, true to their sources, and without surprises."""

import gzip
from pkgutil import resolve_name
from types import SimpleNamespace

import pages
import pytest

import granular
import tensegrity
from figures import FIRST, pictures
from figures._files import write_tables

pytestmark = pytest.mark.unchanged("docs", "README.md")


def test_every_public_name_is_in_the_reference_once():
    found = [
        (package, name)
        for _, modules, _ in pages.rooms().values()
        for package, name, _ in pages.public(modules)
    ]
    assert len(found) == len(set(found))
    offered = {("tensegrity", name) for name in tensegrity.__all__}
    own = {name for name in granular.__all__ if name != "simulate"}
    offered |= {("granular", name) for name in own - {"materials"}}  # a table, without a module
    assert offered - set(found) <= {
        ("tensegrity", name)
        for name in ("catalogue", "files", "objective")  # modules, documented whole
    }


def test_names_of_the_ledger_lead_to_it_and_listed_formulas_are_added():
    lines = [
        "As eq. (5), paper.eq5, of seeds/001.",
        "The largest |u|, (*t.shape, *shape of it), *so*.",
    ]
    pages.link_formulas(None, "function", "granular.sensor_force", None, None, lines)
    text = "\n".join(lines)
    assert "`paper.eq5 <../derivations.html#paper.eq5>`__" in text
    assert "of the paper" in text
    assert r"\|u\|, (\*t.shape, \*shape of it), *so*." in text
    assert "Derived" in text


@pytest.mark.parametrize("name", pages.FORMULAS)
def test_formulas_are_listed_of_names_that_exist(name):
    package, _, _ = name.partition(".")
    found = resolve_name(name if package in ("granular", "derivations") else f"tensegrity.{name}")
    assert callable(found)


def fake(tmp_path, made):
    """A picture with all that one may have, in an output folder of its own."""
    code = tmp_path / "some_picture.py"
    code.write_text("NAME = 'some_picture'\n")
    (tmp_path / "out" / "some").mkdir(parents=True)
    if made:
        folder = tmp_path / "out" / "some"
        (folder / "some_picture.png").write_bytes(b"picture")
        (folder / "some_picture.md").write_text("## T\n\n![T](some_picture.png)\n\nIt is *so*.\n")
        write_tables(folder / "some_picture.csv", {"t": {"x": [1]}}, [{"speed": 2 / 3, "of": "<"}])
    doc = "A wave of seeds/000.\n\nWith *stars*."
    return SimpleNamespace(GROUP="some", __file__=str(code), __doc__=doc)


@pytest.mark.parametrize("made", [True, False])
def test_a_picture_has_a_page_whether_it_was_made_or_not(tmp_path, monkeypatch, made):
    monkeypatch.setattr(pages, "OUTPUT", tmp_path / "out")
    folder = tmp_path / "gallery"
    assert pages.picture_page("some_picture", fake(tmp_path, made), folder) is made
    page = (folder / "some_picture.md").read_text()
    assert page.startswith("# A wave of the talk\n")
    assert r"With \*stars\*." in page
    assert "python -m figures some_picture" in page
    assert "literalinclude} code/some_picture.py" in page
    assert ("was not made" in page) is not made
    assert ('<td><span class="number">0.666667</span></td><td>&lt;</td>' in page) is made
    assert ("It is *so*." in page) is made
    assert (folder / "some_picture.csv.gz").is_file() is made
    if made:
        numbers = gzip.decompress((folder / "some_picture.csv.gz").read_bytes())
        assert numbers == (tmp_path / "out/some/some_picture.csv").read_bytes()


def test_the_gallery_begins_with_what_is_drawn_first_and_shows_each_picture_once():
    groups = list(pages.in_groups(pictures()).values())
    assert groups[0] == list(FIRST)
    assert sorted(name for names in groups for name in names) == sorted(pictures())
    assert min(map(len, groups)) > 1
    assert set(pages.SEEN) == set(FIRST)
    other = SimpleNamespace(__doc__="A wave.\n\nBy eq. (7) it\nsplits. More follows.")
    assert pages.what_to_see("no_such", other) == "By eq. (7) it splits."


def test_a_page_that_does_not_change_is_not_written_again(tmp_path):
    path = tmp_path / "page.md"
    pages.write(path, "one", "", "two")
    assert path.read_text() == "one\n\ntwo\n"
    before = path.stat().st_mtime_ns
    pages.write(path, "one", "two")
    assert path.stat().st_mtime_ns == before
    pages.write(path, "three")
    assert path.read_text() == "three\n"
