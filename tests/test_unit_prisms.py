"""Prisms of any sides and connectivity as units in symbols, and the command that writes them."""

import math

import numpy as np
import pytest
import sympy as sp

from derivations import elastic, prism
from derivations.__main__ import main
from derivations.typeset import latex
from tensegrity import Prism, Structure, TensegrityError
from tensegrity.prisms.equations import symbolic_unit

VALUES = {"l_0": 1.2, "h_0": 0.9, "p_0": 0.15, "k_1": 2.0, "k_2": 30.0, "k_3": 50.0}
BASE, HEIGHT, PRESTRAIN, *K = VALUES.values()
ANGLES = {"alpha": lambda n: sp.pi / n, "S": lambda n: sp.sin(sp.pi / n)}


def value(expression, sides):
    known = VALUES | {name: of(sides) for name, of in ANGLES.items()}
    return float(sp.N(expression.subs({x: known[x.name] for x in expression.free_symbols}), 20))


def printed(unit):
    """Stiffness of the page by the members that are rigid, and tensions and natural lengths."""
    steps = {step.text: step.formulas for step in unit.argument()}
    stiffness = {}
    for words, (first, *definitions) in steps.items():
        if first.lhs == sp.Symbol("K"):
            form = first.rhs
            for one in definitions[::-1]:
                form = form.xreplace({one.lhs: one.rhs})
            rigid = words.removeprefix("For rigid members, ").removesuffix(
                " without bound, it becomes"
            )
            stiffness["none" if rigid == words else rigid] = form
    lists = ("The tensions of the self-stress are", "and the natural lengths")
    return stiffness, *([one.rhs for one in steps[words]] for words in lists)


def test_stiffness_of_three_sides_is_that_of_the_ledger():
    stiffness, _, _ = printed(symbolic_unit(3))
    closed = elastic.axial_stiffness_of_prism().subs(prism.base, sp.Symbol("l_0", positive=True))
    assert value(stiffness["none"], 3) == pytest.approx(value(closed, 3), rel=1e-14)
    for rigid, given in (
        ("k_2", {"base": 0}),
        ("k_3", {"bar": 0}),
        ("k_2 and k_3", {"base": 0, "bar": 0}),
    ):
        form = prism.k_cross * elastic.limit(**given)
        form = form.subs({
            elastic.slenderness: sp.sqrt(3) * prism.reference_height / sp.Symbol("l_0"),
            elastic.extension: prism.prestrain / (1 + prism.prestrain),
            elastic.base_compliance: prism.k_cross / prism.k_base,
            elastic.bar_compliance: prism.k_cross / prism.k_bar,
        })  # fmt: skip
        assert value(stiffness[rigid], 3) == pytest.approx(value(form, 3), rel=1e-14), rigid


@pytest.mark.parametrize("sides", [3, 4, 5, 6, 7, 11])
def test_numbers_of_connectivity_one_are_those_of_the_prism(sides):
    stiffness, _, natural = printed(symbolic_unit(sides))
    for rigid, k_base, k_bar in (
        ("none", *K[1:]),
        ("k_2", math.inf, K[2]),
        ("k_3", K[1], math.inf),
        ("k_2 and k_3", math.inf, math.inf),
    ):
        own = Prism(BASE, HEIGHT, PRESTRAIN, K[0], k_base, k_bar, sides)
        assert value(stiffness[rigid], sides) == pytest.approx(own.axial_stiffness(), rel=1e-13)
    lengths = Prism(BASE, HEIGHT, PRESTRAIN, *K, sides).natural_lengths()
    assert [value(x, sides) for x in natural] == pytest.approx(list(lengths), rel=1e-14)


def structure(sides, connectivity, natural):
    """All nodes of the prism free, the cross strings set back by the connectivity."""
    radius, turn = BASE / (2 * math.sin(math.pi / sides)), 2 * math.pi / sides
    angles = turn * np.arange(sides)
    twist = math.pi / 2 + connectivity * math.pi / sides
    nodes = [[*radius * np.array([math.cos(a + t), math.sin(a + t)]), z]
             for t, z in ((0, 0), (twist, HEIGHT)) for a in angles]  # fmt: skip
    each = range(sides)
    bars = [(i, sides + i) for i in each]
    strings = [(i, sides + (i - connectivity) % sides) for i in each]
    strings += [(s + i, s + (i + 1) % sides) for s in (0, sides) for i in each]
    cross, base, bar = (value(x, sides) for x in natural)
    return Structure(
        nodes, bars, strings, k_bar=[K[2]] * sides, k_string=[K[0]] * sides + [K[1]] * 2 * sides,
        natural_lengths=[bar] * sides + [cross] * sides + [base] * 2 * sides,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("sides", "connectivity"), [(4, 1), (5, 2), (6, 2), (7, 2), (7, 3), (9, 4)]
)
def test_other_connectivities_are_those_of_all_nodes(sides, connectivity):
    """Without load all nodal forces vanish; the stiffness follows from nodes that are all free."""
    stiffness, tensions, natural = printed(symbolic_unit(sides, connectivity))
    own = structure(sides, connectivity, natural)
    groups = [own.tensions[m * sides] for m in (1, 2, 0)]
    assert [value(x, sides) for x in tensions] == pytest.approx(groups, rel=1e-12)
    pulls = np.zeros_like(own.positions)
    for (i, j), tension in zip(own.ends, own.tensions, strict=True):
        along = own.positions[j] - own.positions[i]
        along *= tension / np.linalg.norm(along)
        pulls[i], pulls[j] = pulls[i] + along, pulls[j] - along
    assert np.abs(pulls).max() < 1e-13
    load = np.zeros((2 * sides, 3))
    load[:sides, 2], load[sides:, 2] = -1 / sides, 1 / sides
    moved = np.linalg.lstsq(own.stiffness().toarray(), load.ravel(), rcond=1e-11)[0]
    rise = moved.reshape(load.shape)[[0, sides], 2]
    assert value(stiffness["none"], sides) == pytest.approx(1 / np.ptp(rise), rel=1e-9)


@pytest.mark.parametrize(("sides", "connectivity"), [(5, 2), (6, 1), (6, 2), (8, 3)])
def test_rigid_bases_and_bars_leave_one_closed_form(sides, connectivity):
    """The bars keep their length: a turn dt follows from dh, and the cross strings from both."""
    a, s = connectivity * math.pi / sides, math.sin(math.pi / sides)
    share = PRESTRAIN / (1 + PRESTRAIN)
    closed = 8 * sides * K[0] * share * (HEIGHT * s / BASE / math.cos(a)) ** 2 * math.sin(a)
    both = printed(symbolic_unit(sides, connectivity))[0]["k_2 and k_3"]
    assert value(both, sides) == pytest.approx(closed, rel=1e-14)
    rigid = symbolic_unit(sides, connectivity, rigid_base=True, rigid_bars=True)
    assert rigid.formula("axial stiffness").expression == both


def test_command_writes_the_page_and_latex_of_a_prism(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    given = ["prism", "--sides", "5", "--connectivity", "2"]
    assert main(given) == 0
    page = (tmp_path / "prism_5_2.html").read_text()
    assert "The unit prism_5_2" in page
    assert page.count("<math") > 20
    assert main([*given, "--latex"]) == 0
    text = capsys.readouterr().out
    (rigid,) = (form for _, form in [*printed(symbolic_unit(5, 2))[0].items()][3:])
    assert f"\\[ K = {latex(rigid)} \\]" in text
    assert r"\[ \alpha = \frac{\pi}{5} \]" in text
    assert main(["prism", "--sides", "4", "--rigid", "base", "--rigid", "bars", "--latex"]) == 0
    text = capsys.readouterr().out
    assert "without bound" not in text
    assert r"K = \frac{16 \sqrt{2} h_{0}^{2} k_{1} p_{0}}" in text
    assert main(["prism", "--sides", "3", "--rigid", "bars", "--output", str(tmp_path)]) == 0
    assert (tmp_path / "prism_3_1_rigid_bars.html").exists()


@pytest.mark.parametrize(
    ("words", "given"),
    [
        ("sides 2 must be at least 3", "prism --sides 2"),
        ("connectivity 3 of a prism with 5 sides must be from 1 to 2",
         "prism --sides 5 --connectivity 3"),
        ("connectivity 0 of a prism with 4 sides must be from 1 to 1",
         "prism --sides 4 --connectivity 0"),
        ("--sides: invalid int value: '3.5'", "prism --sides 3.5"),
        ("--sides is for `prism`", "elastic --sides 4"),
        ("--sides is for `prism`", "--check --sides 4"),
        ("--connectivity and --rigid are for `prism` with --sides", "prism --connectivity 2"),
        ("--connectivity and --rigid are for `prism` with --sides", "prism --rigid base"),
        ("--rigid: invalid choice: 'cross'", "prism --sides 3 --rigid cross"),
    ],
)  # fmt: skip
def test_command_refuses_other_prisms_by_name(words, given, capsys):
    with pytest.raises(SystemExit):
        main(given.split())
    assert words in capsys.readouterr().err


def test_a_connectivity_of_no_prism_is_refused():
    with pytest.raises(TensegrityError, match="connectivity 2 of a prism with 4 sides"):
        symbolic_unit(4, 2)
