"""Lattices in a matrix: prestress that survives casting, what it still tunes, gaps, and buckling.

The plane lattice has one node of 1 kg in a cell of 1 m, bars along the diagonals and strings along
the edges.  The resonators are masses of 1 kg on prestressed strings in rigid discs of 0.5 kg, which
move out of the plane.  The octahedra are those of `catalogue.octahedra`, compressed along an axis.
Source: the talk, "freestanding or embedded in a matrix".
"""

import numpy as np
from scipy.optimize import brentq

from tensegrity import Lattice, Matrix, bands, catalogue, moduli

GROUP = "structures"

BARS, STRINGS = [(0, 0, (1, 1)), (0, 0, (1, -1))], [(0, 0, (1, 0)), (0, 0, (0, 1))]
MODULI = np.geomspace(0.01, 100, 17)  # Pa
RADII = (0.05, 0.2)  # m, of patches
DENSITIES = np.linspace(0, 0.4, 9)  # N/m
SOFT = (1e-9, 1.0, 10.0)  # Pa
SHARES = np.linspace(0.02, 0.5, 13)  # of discs in a cell
STRETCHED = (0.4, 1.6)  # N/m: sums of force densities
LAYERS = 6
AROUND = (1e-6, 0.003, 0.01, 0.03, 0.1, 0.3)  # Pa, about the octahedra
PATH = np.pi * np.array([(0, 0), (0.5, 0), (1, 0), (0.5, 1), (1, 1), (0.5, 0.5)])


def net(rest):
    """The plane lattice of some natural lengths of its bars and its strings."""
    lengths = [rest[0]] * 2 + [rest[1]] * 2
    return Lattice([(0, 0)], np.eye(2), BARS, STRINGS, 1.5, 2.0, natural_lengths=lengths)


def force_left(modulus, radius=None, mesh=None):
    """Part of the force of stretched strings that is left after cast and release."""
    around = Matrix(modulus, 0.45, 0.5, radius=radius)
    cast = net((2**0.5, 0.8)).embedded(around, cast="released", mesh=mesh)
    return cast.lattice.tensions[2] / 0.4


def slow(q, modulus):
    """Speed of the slow wave along x [m/s] of the self-stressed lattice."""
    cell = net((2**0.5 * (1 + q / 1.5), 1 - q))
    return moduli(cell.embedded(Matrix(modulus, 0.45, 0.5))).speeds([1, 0])[0]


def resonators(s, share, layers=LAYERS, loss=0.0):
    cell = Lattice([(0, 0)] * 2, np.eye(2), strings=[(0, 1)], k_string=s, natural_lengths=[0.0],
                   mass=[0.5, 1.0])  # fmt: skip
    around = Matrix(2.0, 0.0, 0.5, loss, radius={0: np.sqrt(share / np.pi)}, antiplane=True)
    return cell.embedded(around, mesh=layers)


def gap(s, share, layers=LAYERS):
    """Edges of the gap of resonators [rad/s]."""
    w = bands(resonators(s, share, layers), PATH, count=3).frequencies
    return np.array([w[:, 0].max(), w[:, 1].min()])


def stiff(s, share):
    """The same in a stiff matrix, in closed form."""
    return np.sqrt([s, s * (1 + 1 / (0.5 + 0.5 * (1 - share)))])


def buckling(modulus):
    """Strain and stress at which the octahedra buckle [Pa], compressed along an axis."""
    cast = catalogue.octahedra(k_bar=20.0).embedded(Matrix(modulus, 0.3, 0.1))

    def compressed(strain):
        return cast.strained(np.diag([0.0, 0.0, -strain]))

    found = brentq(lambda e: compressed(e).stability().long, 0.05, 0.6, xtol=1e-5)
    return found, -compressed(found).stress[2, 2]


def data():
    tables = {"force left": {"modulus [Pa]": MODULI}, "speed": {"force density [N/m]": DENSITIES},
              "gap": {"share of discs": SHARES}}  # fmt: skip
    of = tables["force left"]
    of["bonded everywhere"] = np.array([force_left(e) for e in MODULI])
    for a in RADII:
        of[f"discs of {a} m"] = np.array([force_left(e, a, LAYERS) for e in MODULI])
    for e in SOFT:
        speeds = np.array([slow(q, e) for q in DENSITIES])
        tables["speed"][f"modulus {e:g} Pa"] = speeds / speeds[0] - 1
    for s in STRETCHED:
        low, high = np.transpose([gap(s, share) for share in SHARES])
        tables["gap"] |= {f"from at {s} N/m [rad/s]": low, f"to at {s} N/m [rad/s]": high}
    strain, stress = np.transpose([buckling(e) for e in AROUND])
    tables["buckling"] = {"modulus [Pa]": np.array(AROUND), "strain": strain, "stress [Pa]": stress}
    return tables


def draw(figure, tables):
    figure.set_size_inches(9, 7.2)
    (left, speed), (gaps, buckled) = figure.subplots(2, 2)
    modulus, *parts = tables["force left"].values()
    names = ("bonded everywhere", *(f"discs of {a} m" for a in RADII))
    for part, name, style in zip(parts, names, ("k", "C0--", "C3"), strict=True):
        left.semilogx(modulus, 100 * part, style, label=name)
    left.set(xlabel="Young's modulus of the matrix [Pa]", ylabel="force of strings left [%]")
    left.set_title("A soft matrix lets go of the prestress")
    left.legend(frameon=False)
    q, *tuned = tables["speed"].values()
    for part, (name, colour) in zip(
        tuned, {"no matrix": "C0", "1 Pa": "C2", "10 Pa": "C3"}.items(), strict=True
    ):
        speed.plot(q, 100 * part, colour)
        speed.annotate(name, (0.405, 100 * part[-1]), color=colour, va="center")
    speed.set(xlabel="force density q [N/m]", ylabel="change of the slow speed [%]", xlim=(0, 0.52))
    speed.set_title("A stiff one leaves little to tune")
    share = tables["gap"]["share of discs"]
    for k, s in enumerate(STRETCHED):
        low, high = (tables["gap"][f"{side} at {s} N/m [rad/s]"] for side in ("from", "to"))
        gaps.fill_between(share, low, high, color=f"C{k}", alpha=0.3, lw=0)
        gaps.plot(share, np.array([stiff(s, x) for x in share]), f"C{k}--", lw=1)
        gaps.annotate(f"{s} N/m", (0.25, (low[6] + high[6]) / 2), color=f"C{k}", ha="center")
    gaps.set(xlabel="area of the discs over that of the cell", ylabel="frequency [rad/s]")
    gaps.set_title("Area and prestress move the gap (dashed: stiff matrix)")
    modulus, _, stress = tables["buckling"].values()
    buckled.plot(modulus, stress, "C0o-", ms=4)
    buckled.axhline(stress[0], color="0.6", ls=":")
    buckled.annotate("without a matrix", (0.18, stress[0] - 0.009), color="0.4")
    buckled.set(xlabel="Young's modulus of the matrix [Pa]", ylabel="stress at buckling [Pa]",
                ylim=(0, None))  # fmt: skip
    buckled.set_title("Octahedra buckle later in a matrix")


def table(tables):
    def add(quantity, here, closed=""):
        return {"lattice": quantity, "here": float(here), "exact": closed}

    for e in (0.1, 1, 10):
        around = e / (1.45 * (1 - 2 * 0.45))  # C_1111 + C_1122 of the matrix in plane strain
        closed = 1 - 2 / (5 + around)  # 5 N/m: that of the members
        yield add(f"force of strings left after release at {e} Pa", force_left(e), closed)
    for e in SOFT:
        name = "no matrix" if e < 1e-6 else f"{e:g} Pa"
        yield add(f"change of the slow speed by q = 0.4 N/m, {name}", slow(0.4, e) / slow(0, e) - 1)
    for n in (4, 8, 16):
        edges = gap(0.4, 0.04 * np.pi, n)
        for side, edge in zip(("from", "to"), edges, strict=True):
            yield add(f"gap at 0.4 N/m, discs of 0.2 m, {n} layers, {side} [rad/s]", edge)
    lossy = bands(resonators(1.6, 0.04 * np.pi, loss=0.05), PATH[2:3], count=2).losses[0]
    for n, loss in enumerate(lossy):
        yield add(f"loss factor of band {n} at X in a matrix of 0.05, 1.6 N/m", loss)
    strain, stress = (tables["buckling"][name] for name in ("strain", "stress [Pa]"))
    for k, name in ((0, "without a matrix"), (4, "in a matrix of 0.1 Pa")):
        yield add(f"octahedra buckle {name}, strain", strain[k])
        yield add(f"octahedra buckle {name}, stress [Pa]", stress[k])
