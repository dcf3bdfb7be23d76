"""Results of long computations in files: found as long as their sources are the same."""

from pathlib import Path

import numpy as np
import pytest

from figures import _stored, pictures

pytestmark = pytest.mark.unchanged("docs")

TABLES = {
    "one": {"x [m]": np.array([1.0, 0.1]), "what": ["a", "b, c"], "is so": np.array([True, False])},
    "two": {"count": np.array([3])},
}
SOURCES = {"a": "1", "b": "2"}
SELECTED = {"protectors_robust_data"}
"""A search that ends at one of several designs of nearly equal force, as a processor rounds."""


def results():
    """{name: function} of all that is stored for pictures."""
    pictures()
    return dict(_stored.RESULTS)


def counted(calls):
    def make():
        calls.append(1)
        return TABLES

    return make


def current(tmp_path, of, calls, folders=("made", "data")):
    places = [tmp_path / name for name in folders]
    return _stored.current("some", counted(calls), of, "a command", places)


def assert_same(found, expected, rtol=0.0):
    assert found.keys() == expected.keys()
    for table, columns in expected.items():
        assert found[table].keys() == columns.keys()
        for column, values in columns.items():
            here, there = np.asarray(found[table][column]), np.asarray(values)
            if there.dtype.kind == "f":
                np.testing.assert_allclose(here, there, rtol=rtol, atol=0, err_msg=column)
            else:
                np.testing.assert_array_equal(here, there, err_msg=column)


def test_a_result_is_computed_once_and_read_afterwards_as_it_was(tmp_path):
    calls = []
    for _ in range(3):
        assert_same(current(tmp_path, SOURCES, calls), TABLES)
    assert len(calls) == 1
    _, about = _stored.read(tmp_path / "made" / "some.npz")
    assert about[_stored.COMMAND] == "a command"
    assert about[_stored.SOURCES] == SOURCES


def test_a_result_of_other_sources_is_computed_again_and_the_reason_printed(tmp_path, capsys):
    calls = []
    current(tmp_path, SOURCES, calls)
    current(tmp_path, {"a": "1", "b": "3"}, calls)
    assert len(calls) == 2
    assert "computing some: b changed since it was stored" in capsys.readouterr().out
    current(tmp_path, {"another name": "1", "b": "3"}, calls)  # a module that is called otherwise
    assert len(calls) == 2
    current(tmp_path, {"a": "1"}, calls)  # one source less
    assert len(calls) == 3


def test_a_result_under_version_control_is_never_written(tmp_path):
    calls = []
    current(tmp_path, SOURCES, calls, ["data"])
    before = (tmp_path / "data" / "some.npz").read_bytes()
    assert_same(current(tmp_path, SOURCES, calls), TABLES)
    assert len(calls) == 1
    assert not (tmp_path / "made" / "some.npz").exists()
    current(tmp_path, {"a": "4"}, calls)
    assert (tmp_path / "made" / "some.npz").exists()
    assert (tmp_path / "data" / "some.npz").read_bytes() == before


def test_objects_are_refused(tmp_path):
    with pytest.raises(ValueError, match="neither numbers nor text"):
        _stored.save(tmp_path / "x.npz", {"t": {"c": [None]}}, {_stored.SOURCES: SOURCES})


def digest(tmp_path, name, text):
    path = tmp_path / f"{name}.py"
    path.write_text(text)
    return _stored.digest(path)


def test_the_key_of_a_source_is_of_what_it_computes_and_not_of_its_words(tmp_path):
    first = digest(
        tmp_path, "a", '"""Words."""\nimport math\n\ndef f(x):\n    "More."\n    return x + 1\n'
    )
    assert first == digest(
        tmp_path, "b", "from numpy import *\ndef f(x):  # so\n    return (x\n     + 1)\n"
    )
    assert first != digest(tmp_path, "c", "def f(x):\n    return x + 2\n")
    assert first != digest(tmp_path, "d", "def f(y):\n    return y + 1\n")
    assert digest(tmp_path, "e", "f'{x}'") != digest(tmp_path, "f", "f'{x:3}'")


def test_how_a_picture_shows_its_numbers_is_no_source_of_them(tmp_path):
    data, draw = (
        "\nGROUP = 1\ndef data():\n    return {}\n",
        "def draw(figure, tables):\n    pass\n",
    )
    first = digest(tmp_path, "a", data)
    assert first == digest(tmp_path, "b", data + draw)
    assert first != digest(tmp_path, "c", data + draw.replace("draw", "drawn"))


def test_texts_of_errors_and_of_printing_are_no_source_of_numbers(tmp_path):
    kind = "class A:\n    def f(self):\n        {}\n"
    first = digest(tmp_path, "a", kind.format("raise ValueError('one')"))
    assert first == digest(tmp_path, "b", kind.format("raise ValueError('two')"))
    assert first != digest(tmp_path, "c", kind.format("return 1"))
    printing = kind + "    def __str__(self):\n        return 'A'\n"
    assert first == digest(tmp_path, "d", printing.format("raise ValueError('one')"))


def test_a_result_depends_on_helpers_of_its_picture_and_on_what_these_import():
    found = set(_stored.sources("figures.protectors_robust"))
    assert {"figures.protectors_robust", "figures._protectors", "figures._searches"} <= found
    assert "granular.design.searching" in found
    assert "figures._stored" not in found


def test_every_result_is_under_version_control_with_a_command_that_draws_it():
    for name in results():
        _, about = _stored.read(_stored.DATA / f"{name}.npz")
        picture = about[_stored.COMMAND].split()[3]
        assert picture in pictures() or picture in {x.GROUP for x in pictures().values()}
        assert (_stored.DATA / f"{name}.npz").stat().st_size < 200_000
    there = {path.stem for path in Path(_stored.DATA).glob("*.npz")}
    assert there == results().keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", results())
def test_every_result_is_found_again(name):
    make = results()[name]
    there, about = _stored.read(_stored.DATA / f"{name}.npz")
    assert _stored.changed(about, _stored.sources(make.__module__)) == [], about[_stored.COMMAND]
    found = make()
    if name in SELECTED:
        found, there = found["kept"], there["kept"]
        np.testing.assert_allclose(found["touching [N]"], there["touching [N]"], rtol=5e-3)
        np.testing.assert_allclose(found["gain kept"], there["gain kept"], atol=0.03)
        return
    assert_same(found, there, rtol=1e-8)  # a misfit of 1e-3 has round-off of 3e-9 of it
