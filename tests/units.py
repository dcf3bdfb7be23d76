"""Units of known behaviour, for several files of tests: by name, with symbols or numbers."""

import sympy as sp

from tensegrity import Member, Unit

TENTH, HALF, THIRD, HIGH = (sp.Rational(a, b) for a, b in ((1, 10), (1, 2), (1, 3), (9, 5)))
LOW, TALL, TURN = sp.Rational(3, 4), sp.Rational(7, 10), 2 * sp.pi / 9


def x_module(k_bar=50, w0=1, h0=LOW, p=TENTH, k=(1, 2)):
    """Two bars between two cables of the width w, prestrained, and two of the height h."""
    w, h = sp.symbols("w h", positive=True)
    cables, verticals = Member(w, k[0], 2, string=True), Member(h, k[1], 2, string=True)
    bars = Member(sp.sqrt(w**2 + h**2), k_bar, 2)
    return Unit(
        [w], h, [cables, verticals, bars], rest={w: w0, h: h0}, prestrain={cables: p},
        events={"square": w - h},
    )  # fmt: skip


def kresling(k_valley=1, k_mountain=1, n=6, height=HIGH, twist=TURN, radius=1):
    """Creases of two kinds between two polygons; the height is that over their circumradius."""
    h, f = sp.symbols("h f")

    def crease(sign):
        return sp.sqrt(h**2 + 4 * radius**2 * sp.sin((f + sign * sp.pi / n) / 2) ** 2)

    members = [Member(crease(-1), k_mountain, n), Member(crease(1), k_valley, n)]
    return Unit([f], h, members, rest={h: radius * height, f: twist})


def prism(base=1, height=TALL, p=TENTH, k_base=20, k_bar=20, n=3, k_cross=1):
    """The elastic prism, whose strings carry compression too."""
    side, f, h = sp.symbols("l phi h", positive=True)
    squared = 2 * (side / (2 * sp.sin(sp.pi / n))) ** 2
    cross = Member(sp.sqrt(h**2 + squared * (1 - sp.cos(f - 2 * sp.pi / n))), k_cross, n)
    bars = Member(sp.sqrt(h**2 + squared * (1 - sp.cos(f))), k_bar, n)
    return Unit(
        [side, f], h, [cross, Member(side, k_base, 2 * n), bars],
        rest={side: base, h: height, f: sp.pi / 2 + sp.pi / n}, prestrain={cross: p},
        events={"contact": f - sp.pi},
    )  # fmt: skip


def icosahedron(k_strut=sp.oo, strut=2, p=TENTH, k=1):
    """Six struts and 24 strings; the distance a of one pair of struts is controlled."""
    a, b, c = sp.symbols("a b c", positive=True)
    lengths = sp.symbols("l_x l_y l_z", positive=True)
    x, y, z = lengths if k_strut is not sp.oo else (strut,) * 3

    def string(i, j, *halves):
        return sp.sqrt(((halves[0] - j) / 2) ** 2 + halves[1] ** 2 / 4 + i**2 / 4)

    edges = string(a, b, x, y), string(b, c, y, z), string(c, a, z, x)
    strings = [Member(sp.sympify(edge), k, 8) for edge in edges]
    half = sp.sympify(strut) / 2
    rest = {a: half, b: half, c: half}
    if k_strut is sp.oo:
        return Unit([b, c], a, strings, rest=rest, prestrain={strings[0]: p})
    struts, rest = [Member(x, k_strut, 2) for x in lengths], rest | dict.fromkeys(lengths, strut)
    return Unit([b, c, *lengths], a, strings + struts, rest=rest, prestrain={strings[0]: p})


def d_bar(torsion=0):
    """A rhombus of four bars with both diagonals, and hinges at its corners."""
    w, h = sp.symbols("w h", positive=True)
    wide, high = Member(w, 1), Member(h, HALF)
    bars, w0, h0 = Member(sp.sqrt(w**2 + h**2) / 2, 200, 4), sp.Rational(8, 5), sp.Rational(6, 5)
    energy = 2 * torsion * (2 * sp.atan2(h, w) - 2 * sp.atan2(h0, w0)) ** 2
    rest = {w: w0, h: h0}
    return Unit([w], h, [wide, high, bars], energy, rest=rest, prestrain={wide: 2 * TENTH})


def twin_strings(k_bar=100, n=3, squared=THIRD, p=TENTH):
    """Upright bars between two polygons, with strings of both hands."""
    f, h = sp.symbols("phi h")

    def length(turn):
        return sp.sqrt(h**2 + 2 * squared * (1 - sp.cos(f + turn)))

    strings = [Member(length(sign * 2 * sp.pi / n), 1, n) for sign in (1, -1)]
    members = [Member(length(0), k_bar, n), *strings]
    return Unit([f], h, members, rest={f: 0, h: 1}, prestrain=dict.fromkeys(strings, p))


def class_two(k_middle=40):
    """Two prisms of opposite hands, bars end to end."""
    end, middle, f, h = sp.symbols("l_e l_m phi h", positive=True)

    def length(turn):
        return sp.sqrt(
            h**2 / 4 + end**2 / 3 + middle**2 / 3 - 2 * end * middle * sp.cos(f - turn) / 3
        )

    cross = Member(length(2 * sp.pi / 3), 1, 6)
    members = [Member(length(0), 20, 6), cross, Member(end, 20, 6), Member(middle, k_middle, 3)]
    rest = {end: 1, middle: 1, h: sp.Rational(7, 5), f: 5 * sp.pi / 6}
    return Unit([end, middle, f], h, members, rest=rest, prestrain={cross: TENTH})


def snap_back():
    """An arch of two bars, pressed through a spring in series."""
    x, h = sp.symbols("x h")
    energy = (sp.sqrt(1 + x**2) - sp.sqrt(sp.Rational(5, 4))) ** 2 + (h - x) ** 2 / 40
    return Unit([x], h, energy=energy, rest={x: HALF, h: HALF})


def arch(kappa=1e-3):
    """An arch of two bars on hinges, with a spring in series."""
    x, h, k = sp.symbols("x h kappa")
    members = [Member(sp.sqrt(1 + x**2), 1.0, 2), Member(h - x, 0.5, natural=0.0)]
    hinges = k * (sp.atan(x) - sp.atan(0.5)) ** 2
    return Unit([x], h, members, hinges, {k: kappa}, {x: 0.5, h: 0.5})
