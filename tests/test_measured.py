"""Files from the laboratory: dialects, units, signs, and what is wrong by line and value."""

import doctest
import re

import numpy as np
import pytest

from tensegrity import Prism, TensegrityError, fit, read_curve
from tensegrity.prisms import measured

PRISM = Prism(1.0, 1.0, 0.1, 2.0, 5.0, 50.0)
SHORTENING = np.linspace(0.01, 0.15, 12)  # [m]
LOAD = -PRISM.potential().tension(-SHORTENING) + 1e-4 * np.cos(9 * np.arange(12))  # [N]


def written(tmp_path, text, name="curve.txt", encoding="utf-8"):
    path = tmp_path / name
    path.write_bytes(text.encode(encoding))
    return path


def in_english(x, y):
    """Commas between columns, comments, millimetres and newtons."""
    rows = [f"{1e3 * a!r},{b!r}" for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    return "\n".join(["# specimen 3", "Extension (mm),Load (N)", *rows, ""])


def in_german(x, y):
    """Semicolons, decimal commas, a time, a row of units, a byte order mark; negative."""
    rows = [
        f"{n};{-1e3 * a!r};{-1e-3 * b!r}".replace(".", ",")
        for n, (a, b) in enumerate(zip(x.tolist(), y.tolist(), strict=True))
    ]
    return "\r\n".join(["\ufeffProbe: 3", "", "Zeit;Weg;Kraft", "s;mm;kN", *rows])


def in_american(x, y):
    """Blanks, exponents, inches and pounds, load first; the time stops the first line."""
    rows = [
        f"  10:{n:02d}:00  {b / 4.4482216152605:.17e}   {a / 0.0254:.17E}"
        for n, (a, b) in enumerate(zip(x.tolist(), y.tolist(), strict=True))
    ]
    return "\n".join(["Date 11 23", "Time Force Travel", *rows])


DIALECTS = [
    (in_english, {}),
    (in_german, {"x": "-mm", "y": "-kN", "columns": ("Weg", "Kraft")}),
    (in_american, {"x": "in", "y": "lbf", "columns": (2, "Force")}),
    (lambda x, y: in_german(x, y).replace(";", "\t"), {"x": "-mm", "y": "-kN", "columns": (1, 2)}),
    (lambda x, y: in_english(x, y).replace(",", "  "), {}),
    (lambda x, y: re.sub(r"([-\d.e]+),([-\d.e]+)", r'"\1", "\2"', in_english(x, y)), {}),
]


@pytest.mark.parametrize(("dialect", "given"), DIALECTS)
def test_one_curve_in_all_dialects_gives_one_fit(tmp_path, dialect, given):
    curve = read_curve(written(tmp_path, dialect(SHORTENING, LOAD)), **given)
    assert curve.shortening == pytest.approx(SHORTENING, rel=1e-14)
    assert curve.load == pytest.approx(LOAD, rel=1e-14)
    start = Prism(1.0, 1.0, 0.08, 2.0, 6.0, 50.0)
    wanted, found = fit(SHORTENING, LOAD, start), fit(*curve, start)
    assert found.values == pytest.approx(wanted.values, rel=1e-7, abs=1e-10)
    assert found.prism.prestrain == pytest.approx(0.1, rel=0.01)


@pytest.mark.parametrize(
    ("x", "y", "length", "force"),
    [
        ("m", "N", 1.0, 1.0),
        ("um", "mN", 1e-6, 1e-3),
        ("µm", "MN", 1e-6, 1e6),
        ("nm", "uN", 1e-9, 1e-6),
        ("cm", "kgf", 1e-2, 9.80665),
        ("in", "lbf", 0.0254, 0.45359237 * 9.80665),
        ("-in", "-kN", -0.0254, -1e3),
    ],
)
def test_units_have_their_si_values_and_a_minus_turns_the_sign(tmp_path, x, y, length, force):
    curve = read_curve(written(tmp_path, "0.5 2\n"), x, y)
    assert curve.shortening == pytest.approx([0.5 * length], rel=1e-15)
    assert curve.load == pytest.approx([2 * force], rel=1e-15)


@pytest.mark.parametrize(
    ("text", "points"),
    [
        ("0,1 0,2\n0,3 4\n", [(0.1, 0.2), (0.3, 4)]),  # blanks between decimal commas
        ("0, 1\n0.5, 2\n", [(0, 1), (0.5, 2)]),
        ("1,2\n3,4", [(1, 2), (3, 4)]),
        ("0;0\n0,5;1,5\n", [(0, 0), (0.5, 1.5)]),  # no decimal mark in the first line
        ("\t.5\t+1.\n\t-.5E1\t1e-3\n", None),
        ("x y\n%1 2\n1 2\n\n# no\n  3   4  \n", [(1, 2), (3, 4)]),
        ("Kraft [µN] 5\n1\t2", [(1, 2)]),
    ],
)
def test_columns_and_decimals_follow_from_the_first_line_of_numbers(tmp_path, text, points):
    columns = (0, 1) if points else (1, 2)
    curve = read_curve(written(tmp_path, text, encoding="latin-1"), "m", "N", columns)
    wanted = points or [(0.5, 1), (-5, 1e-3)]
    assert np.array(curve).T.tolist() == [list(map(float, pair)) for pair in wanted]


def test_names_may_stand_in_a_comment(tmp_path):
    path = tmp_path / "saved.txt"
    np.savetxt(path, np.column_stack([LOAD, SHORTENING]), header="load shortening")
    curve = read_curve(path, "m", "N", ("shortening", "load"))
    assert (curve.shortening == SHORTENING).all()


def test_a_fit_reads_files_in_metres_and_newtons(tmp_path):
    path = tmp_path / "saved.csv"
    np.savetxt(path, np.column_stack([SHORTENING, LOAD]), delimiter=",", header="x,y")
    found = fit(path, None, PRISM)
    assert found.shortening.tolist() == SHORTENING.tolist()
    assert found.load.tolist() == LOAD.tolist()


@pytest.mark.parametrize(
    ("text", "given", "words"),
    [
        ("", {}, "0 lines: no line has numbers in columns (0, 1)"),
        ("\n\n# 1 2\n", {}, "3 lines: no line has numbers in columns (0, 1)"),
        ("mm N\n1\n2\n", {}, "3 lines: no line has numbers"),
        ("1,2\n3,nan\n", {}, "line 2, column 1: 'nan' is no finite number"),
        ("a b\n1 2\n3 #N/A\n", {}, "line 3, column 1: '#N/A' is no finite number"),
        ("1,2\n3,\n", {}, "line 2, column 1: '' is no finite number"),
        ("1 2\n3 1e999\n", {}, "line 2, column 1: '1e999' is no finite number"),
        ("1 2\n\n3 inf\n", {}, "line 3, column 1: 'inf' is no finite number"),
        (
            "1 2\n3 __import__('os')\n",
            {},
            "line 2, column 1: \"__import__('os')\" is no finite number",
        ),
        ("1\t2\n3\t1,234.5\n", {}, "line 2, column 1: '1,234.5' is no finite number"),
        (
            "0.5\t2\n0.6\t1,234\n",
            {},
            "line 2, column 1: 1,234 has a decimal comma, values before it a",
        ),
        ("1;2\n3;4;5\n", {}, "line 2: 3 columns, must be 2 as in line 1"),
        ("h\n1 2 3\n4 5\n", {}, "line 3: 2 columns, must be 3 as in line 2"),
        ("1 2\nend of test\n", {}, "line 2: 3 columns, must be 2 as in line 1"),
        ("a;b\n1;2\n", {"columns": ("a", "c")}, "no line of the header names columns ('a', 'c')"),
        ("a b;c d\n1;2\n", {"columns": ("a", "d")}, "columns ('a', 'd'), line 1 is 'a b;c d'"),
        ("a;b\n1;2\n", {"columns": (0, 2)}, "no line has numbers in columns (0, 2)"),
        ("1 2\n", {"columns": (0,)}, "1 columns, must be two"),
        ("1 2\n", {"columns": (-1, 0)}, "column -1 must be at least 0"),
        ("1 2\n", {"x": "mile"}, "unit x 'mile' must be, with or without -, of m, nm"),
        ("1 2\n", {"y": "mm"}, "unit y 'mm' must be, with or without -, of N, nN"),
        ("1 2\n", {"x": "--mm"}, "unit x '--mm' must be"),
        ("1,2" + "3" * 200_000, {}, "line 1, column 1: '2333"),
        ('1,"2' + "3" * 200_000, {}, "field larger than field limit"),
    ],
)
def test_what_is_no_curve_is_refused_by_line_and_value(tmp_path, text, given, words):
    path = written(tmp_path, text)
    with pytest.raises(TensegrityError, match=re.escape(words)) as caught:
        read_curve(path, **given)
    assert given or str(path) in str(caught.value)


def test_files_that_are_none_are_named(tmp_path):
    for path in (tmp_path / "none.txt", tmp_path):
        with pytest.raises(TensegrityError, match=rf"{path} cannot be read: \w+"):
            read_curve(path)
    with pytest.raises(TensegrityError, match="path 3 is not a path"):
        read_curve(3)


def test_examples_of_measured_curves_give_what_they_say():
    assert doctest.testmod(measured) == (0, 5)
