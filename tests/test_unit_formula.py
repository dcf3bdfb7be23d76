"""Closed forms of units: equal to those of papers, and as LaTeX, MathML and C."""

import ctypes
import subprocess
import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest
import sympy as sp
from units import HALF, arch, class_two, d_bar, icosahedron, kresling, prism, x_module

from derivations.__main__ import main
from tensegrity import Member, Prism, TensegrityError, Unit

W0, H0, P, K, KC, KV, KB = sp.symbols("w_0 h_0 p k k_c k_v k_b", positive=True)
STIFFNESS = "axial stiffness"


def test_stiffness_of_the_x_module_is_the_closed_form():
    form = x_module(sp.oo, W0, H0, P, (KC, KV)).formula(STIFFNESS).expression
    ratio = (H0 / W0) ** 2
    assert sp.simplify(form - 2 * KV - 2 * KC * (ratio - P / (1 + P) * (1 + ratio))) == 0


def test_stiffness_of_elastic_bars_has_linear_numerator_and_denominator_in_the_compliance():
    c = sp.Symbol("c", positive=True)
    form = x_module(1 / c, W0, H0, P, (KC, KV)).formula(STIFFNESS).expression
    assert [sp.degree(part, c) for part in sp.fraction(form)] == [1, 1]
    rigid = x_module(sp.oo, W0, H0, P, (KC, KV)).formula(STIFFNESS).expression
    assert sp.simplify(form.subs(c, 0) - rigid) == 0


def test_stiffness_of_the_icosahedron_is_the_closed_form_whatever_the_strut():
    length = sp.Symbol("L", positive=True)
    formula = icosahedron(sp.oo, length, P, K).formula(STIFFNESS)
    assert formula.expression == 12 * K * P * (1 + 4 * P) / ((1 + P) * (1 + 12 * P))
    assert formula.where == {}
    latex = r"\frac{12 k p \left(4 p + 1\right)}{\left(p + 1\right) \left(12 p + 1\right)}"
    assert formula.latex() == latex
    elastic = icosahedron(sp.Symbol("s"), length, P, K).formula(STIFFNESS).whole
    assert sp.simplify(sp.limit(elastic, "s", sp.oo) - formula.expression) == 0


def test_stiffness_of_kresling_is_the_closed_form():
    ka, kb, f0 = sp.symbols("k_a k_b f_0", positive=True)
    unit = kresling(kb, ka, 6, H0, f0)
    f, h = unit.coordinates
    (ah, af), (bh, bf) = ([sp.diff(m.length, x).subs({h: H0, f: f0}) for x in (h, f)]
                          for m in unit.members)  # fmt: skip
    closed = 6 * ka * kb * (ah * bf - af * bh) ** 2 / (ka * af**2 + kb * bf**2)
    ratio = unit.formula(STIFFNESS).whole / closed
    for height, twist in ((sp.Rational(9, 5), sp.Rational(7, 10)), (sp.Rational(3, 4), 2)):
        at = {H0: height, f0: twist, ka: 3, kb: sp.Rational(2, 3)}
        assert abs(sp.N(ratio.subs(at), 30) - 1) < 1e-25


@pytest.mark.parametrize("sides", [3, 4, 5])
def test_stiffness_of_a_prism_is_that_of_its_own_derivation(sides):
    base, *k = sp.symbols("l_0 k_1 k_2 k_3", positive=True)
    form = prism(base, H0, P, *k[1:], sides, k[0]).formula(STIFFNESS).whole
    value = sp.lambdify([base, H0, P, *k], form)
    for given in ((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (7.0, 3.0, 0.1, 2.0, 11.0, 4.0)):
        own = Prism(*given, sides).axial_stiffness()
        assert value(*given) == pytest.approx(own, rel=1e-13)


def test_class_two_of_equal_prisms_has_half_of_the_stiffness_of_one():
    """With middle strings of twice the stiffness."""
    half = prism().formula(STIFFNESS).whole / 2
    assert sp.N(class_two(40).formula(STIFFNESS).whole / half, 25) == pytest.approx(1, rel=1e-20)


@pytest.mark.parametrize("unit", [x_module(), prism(), d_bar(sp.Rational(1, 50)), kresling()])
def test_formulas_of_numbers_are_the_numbers(unit):
    formula = unit.formula(STIFFNESS)
    assert float(sp.N(formula.whole, 20)) == pytest.approx(unit.axial_stiffness(), rel=1e-15)
    for k in range(len(unit.members)):
        tension, natural = (unit.formula(f"{x}_{k}").whole for x in ("tension", "natural_length"))
        assert float(tension) == pytest.approx(unit.self_stress()[k], rel=1e-14, abs=1e-15)
        assert float(natural) == pytest.approx(unit.natural_lengths()[k], rel=1e-14)


def test_springs_without_length_at_rest_have_formulas():
    form = arch().formula(STIFFNESS).whole.subs("kappa", 1e-3)
    assert float(form) == pytest.approx(arch().axial_stiffness(), rel=1e-14)
    assert arch().formula("natural_length_1").expression == 0


def test_c_computes_the_stiffness(tmp_path):
    formula = prism(1, H0, P, KB, KC).formula(STIFFNESS)
    assert formula.where  # it is long
    (tmp_path / "own.c").write_text(formula.c("stiffness"))
    built = tmp_path / "own.so"
    command = ["cc", "-std=c99", "-Wall", "-Werror", "-shared", "-fPIC", "-o", str(built)]
    subprocess.run([*command, str(tmp_path / "own.c"), "-lm"], check=True)
    function = ctypes.CDLL(str(built)).stiffness
    function.argtypes, function.restype = [ctypes.c_double] * 4, ctypes.c_double
    wanted = Prism(1, 0.7, 0.1, 1, 20, 50).axial_stiffness()
    assert function(0.7, 20.0, 50.0, 0.1) == pytest.approx(wanted, rel=1e-13)  # sorted by name


def test_mathml_is_well_formed_and_print_shows_the_definitions():
    formula = prism(1, H0, P, KB, KC).formula(STIFFNESS)
    assert ET.fromstring(formula.mathml()).tag == "div"
    assert str(formula).startswith(f"{STIFFNESS} = ")
    assert f"{next(iter(formula.where))} = " in str(formula)
    assert formula.latex().startswith(r"\frac{")


def quadratic(count, **given):
    """Energy of full coupling of many coordinates, every coefficient with a name."""
    q = sp.symbols(f"q:{count}")
    s = [[sp.Symbol(f"s_{min(i, j)}_{max(i, j)}") for j in range(count)] for i in range(count)]
    energy = sum(s[i][j] * q[i] * q[j] for i in range(count) for j in range(count)) / 2
    values = {x: 1 / (1 + i + j) for i, row in enumerate(s) for j, x in enumerate(row)}
    return Unit(q[:-1], q[-1], energy=energy, rest=dict.fromkeys(q, 0),
                parameters={k: v for k, v in values.items() if k not in given})  # fmt: skip


def test_a_formula_that_would_be_too_long_is_a_number_and_says_so():
    unit = quadratic(8)
    formula = unit.formula(STIFFNESS)
    assert formula.expression == pytest.approx(unit.axial_stiffness(), rel=1e-12)
    assert "more than 2000 terms" in formula.note
    assert "a number" in str(formula)
    short = quadratic(3).formula(STIFFNESS)
    assert not short.note
    assert len(short.expression.free_symbols) == 6


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("formula 'load' must be one of axial stiffness, tension_0, ", lambda u: u.formula("load")),
        ("name 1 is not a str", lambda u: u.formula(1)),
        ("name 'a b' must be an identifier of C", lambda u: u.formula(STIFFNESS).c("a b")),
        ("no self-stress at rest: a force is left on w", lambda _: Unit(
            [W0], H0, [Member(W0, K), Member(H0, 1)], rest={W0: 1, H0: 1},
            prestrain={Member(W0, K): P}).formula(STIFFNESS)),
        ("motion without stiffness at rest", lambda _: Unit(
            sp.symbols("x y"), H0, [Member(H0, K)], (sp.Symbol("x") + sp.Symbol("y")) ** 2,
            rest={H0: 1, "x": 0, "y": 0}).formula(STIFFNESS)),
        ("leaves 1 states of self-stress open", lambda _: Unit(
            [W0], H0, [Member(W0, K), Member(W0, 1), Member(H0, 1), Member(
                sp.sqrt(W0**2 + H0**2), KB)], rest={W0: 1, H0: 1},
            prestrain={Member(W0, K): P}).formula(STIFFNESS)),
    ],
)  # fmt: skip
def test_formulas_that_are_not_there_are_refused(words, call):
    with pytest.raises(TensegrityError) as error:
        call(x_module())
    assert words in str(error.value)


OWN = """
import sympy as sp
from tensegrity import Member, Unit

w, h, k, s, p, w0, h0 = sp.symbols("w h k s p w_0 h_0", positive=True)
cables, posts = Member(w, k, 2), Member(h, 2 * k, 2)
bars = Member(sp.sqrt(w**2 + h**2), s, 2)
cross = Unit([w], h, [cables, posts, bars], rest={w: w0, h: h0}, prestrain={cables: p})
"""


def test_command_makes_a_page_and_latex_of_units_in_a_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(OWN)
    assert main(["unit", "own.py"]) == 0
    page = (tmp_path / "unit.html").read_text()
    assert "The unit cross" in page
    assert page.count("<math") >= 15
    assert "The units cross" in capsys.readouterr().out
    assert main(["unit", "own.py", "--latex"]) == 0
    text = capsys.readouterr().out
    assert r"{T}_{0} = \frac{k p w_{0}}{p + 1}" in text
    assert "For rigid members, s without bound" in text
    assert r"\infty" not in text


def test_a_unit_with_values_shows_them_and_the_limit_of_rigid_members():
    """Stiffness of both kinds without bound would be infinite, and is left out."""
    s = sp.Symbol("s", positive=True)
    values = {s: 50, KV: 2, KC: 1, W0: 1, H0: HALF, P: HALF / 5}
    unit = replace(x_module(s, W0, H0, P, (KC, KV)), parameters=values)
    steps = {step.text: step.formulas for step in unit.argument()}
    assert sp.Eq(KV, 2, evaluate=False) in steps["with the parameters"]
    limits = [words for words in steps if words.startswith("For rigid members")]
    assert limits == ["For rigid members, s without bound, it becomes"]
    rigid = x_module(sp.oo, W0, H0, P, (KC, KV)).formula(STIFFNESS).whole
    assert sp.simplify(steps[limits[0]][0].rhs - rigid) == 0


def test_derivations_and_entries_of_the_ledger_are_printed_as_latex(capsys):
    assert main(["member", "--latex"]) == 0
    text = capsys.readouterr().out
    assert r"\[ \frac{k \left(l - l_{N}\right)^{2}}{2} \]" in text
    assert r"l\_N" in text
    assert main(["talk.hooke_cross", "--latex"]) == 0
    assert capsys.readouterr().out.lstrip().startswith(r"x_{1} = \frac{k_{1}")


@pytest.mark.parametrize("given", [["unit"], ["member", "own.py"], ["nothing", "--latex"]])
def test_command_refuses_what_it_does_not_know(given):
    with pytest.raises(SystemExit):
        main(given)
