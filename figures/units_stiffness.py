"""The stiffness of an icosahedron: the formula of its unit, and what elastic struts take from it.

Six struts and 24 strings (1 N/m), one pair of struts pressed together: with rigid struts the
stiffness is the formula below the curves, whatever their length, as the unit's `formula` gives it;
struts of 50 N/m take 0.35 % at a prestrain of 0.1, softer ones more.  Dots are numbers of
`axial_stiffness` with rigid struts.
"""

import numpy as np
import sympy as sp

from figures._draw import name_curves, note
from tensegrity import Member, Unit

GROUP = "units"

A, B, C = PLACES = sp.symbols("a b c", positive=True)  # distances of the three pairs of struts
LENGTHS = sp.symbols("l_x l_y l_z", positive=True)
K, P, LENGTH = sp.symbols("k p L", positive=True)
STRUT = 2  # m
STIFF = {"50 N/m": 50.0, "5 N/m": 5.0}  # struts that are not rigid
PRESTRAIN = 0.1  # of the printed numbers
FINE, COARSE = np.linspace(0.0, 1.0, 201)[1:], np.linspace(0.0, 1.0, 11)[1:]


def icosahedron(k, p, strut=STRUT, k_strut=None):
    """The unit, with rigid struts where no stiffness is given."""
    x, y, z = (strut,) * 3 if k_strut is None else LENGTHS

    def string(i, j, one, other):
        return sp.sqrt(((one - j) / 2) ** 2 + (sp.sympify(other) / 2) ** 2 + (i / 2) ** 2)

    edges = string(A, B, x, y), string(B, C, y, z), string(C, A, z, x)
    members, rest = [Member(edge, k, 8) for edge in edges], dict.fromkeys(PLACES, sp.S(strut) / 2)
    prestrain, inner = {members[0]: p}, [B, C]
    if k_strut is not None:
        members += [Member(length, k_strut, 2) for length in LENGTHS]
        inner, rest = [*inner, *LENGTHS], rest | dict.fromkeys(LENGTHS, strut)
    return Unit(inner, A, members, rest=rest, prestrain=prestrain)


def data():
    formula = icosahedron(K, P, LENGTH).formula("axial stiffness")
    value = sp.lambdify([K, P], formula.expression)
    tables = {"formula": {"latex": [formula.latex()]}}
    tables["rigid"] = {"prestrain": FINE, "stiffness": value(1.0, FINE)}
    dots = [icosahedron(1.0, float(p)).axial_stiffness() for p in COARSE]
    tables["dots"] = {"prestrain": COARSE, "stiffness": dots}
    for name, k_strut in STIFF.items():
        soft = icosahedron(1.0, P, STRUT, k_strut).formula("axial stiffness").expression
        found = sp.lambdify(P, soft)(FINE)
        tables[name] = {"prestrain": FINE, "stiffness": found,
                        "lost": 1 - found / tables["rigid"]["stiffness"]}  # fmt: skip
    return tables


def draw(figure, tables):
    """The formula, the stiffness against prestrain, and what elastic struts take from it."""
    figure.set_size_inches(9, 4)
    whole, lost = figure.subplots(1, 2)
    rigid = tables["rigid"]
    whole.plot(rigid["prestrain"], rigid["stiffness"], "C0", label="rigid struts")
    for k, name in enumerate(STIFF, 1):
        of = tables[name]
        whole.plot(of["prestrain"], of["stiffness"], f"C{k}", label=f"struts of {name}")
        lost.plot(of["prestrain"], 100 * of["lost"], f"C{k}", label=f"struts of {name}")
    dots = tables["dots"]
    whole.plot(dots["prestrain"], dots["stiffness"], "o", color="C0", mfc="white", zorder=3)
    words = f"$K = {tables['formula']['latex'][0]}$"
    note(whole, words, (0.64, 0.3), inside=True, ha="center", va="center", fontsize=17)
    whole.set_title("stiffness, with the formula of rigid struts")
    whole.set(xlabel="prestrain p of the strings", ylabel="stiffness K [N/m]")
    lost.set(xlabel="prestrain p of the strings", ylabel="stiffness lost to the struts [%]")
    lost.set_title("what elastic struts take from it")
    for axes, top in ((whole, 2.6), (lost, 5.5)):
        axes.set(xlim=(0, 1), ylim=(0, top))
        name_curves(axes)


def table(tables):
    """Stiffness at one prestrain."""
    for name, of in tables.items():
        if "stiffness" in of and name != "dots":
            k = int(np.abs(of["prestrain"] - PRESTRAIN).argmin())
            yield {"struts": name, "prestrain": float(of["prestrain"][k]),
                   "stiffness [N/m]": float(of["stiffness"][k])}  # fmt: skip
