"""Prestress tunes lattices: their phases, their gaps, and their effective mass.

The octahedra are those of `catalogue.octahedra`, their strings shortened at free lattice vectors,
with bars that buckle at a given load.  The prisms alternate, one of a kind that stiffens under
preload and one that softens; the resonators are masses on prestressed strings in a frame of bars.
Source: the talk, "negative effective elastic moduli", "wave-steering and stop-bands".
"""

import numpy as np
from scipy.optimize import brentq

from tensegrity import Lattice, Prism, bands, catalogue, decay, effective_mass, moduli

GROUP = "structures"

LOAD = 0.02  # N, at which the bars of the octahedra buckle
EDGES = np.array([-1e-6, 1e-6, 0.05013, 0.050131])  # on both sides of the jumps
SHORTER = np.sort(np.concatenate([[-0.02], np.geomspace(1e-5, 0.1, 60), EDGES]))
STIFFENING = Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0)
SOFTENING = Prism(1.0, 0.23, 0.1, 9.0, 90.0, 900.0)
PRELOADS = np.linspace(0.0, 0.06, 25)  # N
DENSITIES = np.linspace(0.0, 0.8, 17)  # N/m
FRAME = {"k_bar": 20.0, "k_diagonal": 5.0, "masses": (1.0, 2.0)}
SHOWN = (0.1, 0.4)  # force densities of the effective masses
PHASES = np.linspace(-np.pi, np.pi, 33)


def resonators(q):
    return catalogue.resonators(force_density=q, **FRAME)


def octahedra(shorter):
    """The lattice with strings of 1/(1 + shorter) of their lengths, free of stress."""
    start = catalogue.octahedra(1.0, 0.0, 20.0)
    lengths = np.where(start.is_string, start.lengths / (1 + shorter), start.lengths)
    scale = 1 - max(shorter - 0.05, 0.0)  # near the equilibrium, where bars buckle
    return start.at(scale * start.positions, scale * start.vectors, natural_lengths=lengths,
                    buckling=LOAD)  # fmt: skip


def speeds(shorter):
    """Longitudinal and shear waves along an axis [m/s]; strings are slack below 0."""
    lattice = octahedra(shorter)
    found = moduli(lattice.equilibrium() if shorter > 0 else lattice)
    squares = [found.tangent[0, 0, 0, 0], found.tangent[0, 1, 0, 1]]
    return np.sqrt(np.maximum(squares, 0.0) / found.density)


def stiffness(prism, preload):
    return float(prism.potential(preload).stiffness(0.0))


def closing():
    """The preload at which the gap of the alternating prisms closes [N]."""
    return brentq(lambda f: stiffness(STIFFENING, f) - stiffness(SOFTENING, f), 0.0, 0.05,
                  xtol=1e-14)  # fmt: skip


def edges(preload):
    """Edges of the gap of alternating prisms between unit masses [rad/s], by their lattice."""
    k = [stiffness(prism, preload) for prism in (STIFFENING, SOFTENING)]
    row = Lattice([(0, 0), (1, 0)], [(2, 0)], [(0, 1), (1, 0, 1)], k_bar=k)
    return bands(row, [[np.pi]]).frequencies[0, 2:]


def ranges(q):
    """Lowest and highest frequency of each branch of the resonators [rad/s], (branches, 2)."""
    grid = np.stack(np.meshgrid(PHASES, PHASES), axis=-1).reshape(-1, 2)
    w = bands(resonators(q), grid).frequencies
    return np.stack([w.min(axis=0), w.max(axis=0)], axis=1)


def exact(q):
    """Edges of the resonance gap in closed form [rad/s]."""
    frame, inner = FRAME["masses"]
    w = np.sqrt(2 * (1 + q) / inner)
    return w, w * np.sqrt(1 + inner / frame)


def mass(lattice, frequency):
    """Effective mass of a cell along an axis [kg]."""
    return float(effective_mass(lattice, [0], [frequency])[0, 0, 0])


def data():
    octahedral = np.array([speeds(x) for x in SHORTER])
    found = np.array([edges(f) for f in PRELOADS])
    branches = np.array([ranges(q) for q in DENSITIES])
    tables = {
        "octahedra": {"strings shorter by": SHORTER, "longitudinal [m/s]": octahedral[:, 0],
                      "shear [m/s]": octahedral[:, 1]},
        "prisms": {"preload [N]": PRELOADS, "lower edge [rad/s]": found[:, 0],
                   "upper edge [rad/s]": found[:, 1]},
        "resonators": {"force density [N/m]": DENSITIES,
                       **{f"branch {n} {side} [rad/s]": branches[:, n, k]
                          for n in range(4) for k, side in enumerate(("from", "to"))}},
    }  # fmt: skip
    for q in SHOWN:
        low, _ = exact(q)
        w = np.concatenate([np.linspace(0, 0.995, 120), np.linspace(1.005, 2.2, 200)]) * low
        phases = decay(resonators(q), w, 0, 0.4)
        tables[f"mass at {q}"] = {
            "frequency [rad/s]": w, "mass [kg]": effective_mass(resonators(q), [0], w)[:, 0, 0],
            "decay of the slowest": np.abs(phases.imag).min(axis=1),
        }  # fmt: skip
    return tables


def draw(figure, tables):
    figure.set_size_inches(9, 7.2)
    (phases, prisms), (gaps, mass) = figure.subplots(2, 2)
    x, long, shear = tables["octahedra"].values()
    phases.plot(100 * x, long, "C0")
    phases.plot(100 * x, shear, "C3")
    phases.annotate("shear", (0.4, 0.222), color="C3")
    phases.annotate("longitudinal", (1.7, 0.06), color="C0")
    phases.annotate("slack", (-1.9, 0.008))
    phases.annotate("bars buckled", (6.0, 0.17))
    phases.set(xlabel="strings shorter by [%]", ylabel="speed along an axis [m/s]")
    phases.set_title("Octahedra have three phases")
    f, low, high = tables["prisms"].values()
    prisms.fill_between(f, low, high, color="0.85")
    prisms.plot(f, low, "C0", f, high, "C0")
    prisms.axvline(closing(), color="C3", ls=":")
    words = f"closes at\n{closing():.5f} N"
    prisms.annotate(words, (closing() - 0.0005, 1.9), color="C3", ha="right")
    prisms.annotate("gap", (0.05, 2.04))
    prisms.set(xlabel="preload [N]", ylabel="frequency [rad/s]")
    prisms.set_title("Preload closes a gap and opens it again")
    q, *branches = tables["resonators"].values()
    for n in range(4):
        gaps.fill_between(q, branches[2 * n], branches[2 * n + 1], color="C0", alpha=0.25, lw=0)
    for edge in exact(q):
        gaps.plot(q, edge, "k--", lw=1)
    gaps.annotate("no wave", (0.3, 1.5))
    gaps.set(xlabel="force density of the strings [N/m]", ylabel="frequency [rad/s]", ylim=(0, 4))
    gaps.set_title("Prestress moves a complete gap (dashed: exact)")
    for k, q in enumerate(SHOWN):
        w, values, _ = tables[f"mass at {q}"].values()
        for side in (w < exact(q)[0], w > exact(q)[0]):
            mass.plot(w[side], values[side], f"C{k}")
        mass.axvspan(*exact(q), color=f"C{k}", alpha=0.12)
        side, at = (("right", exact(q)[0] - 0.05), ("left", exact(q)[0] + 0.2))[k]
        mass.annotate(f"{q} N/m", (at, -14), color=f"C{k}", ha=side)
    mass.axhline(0, color="0.6", lw=0.8)
    mass.set(xlabel="frequency [rad/s]", ylabel="effective mass of a cell [kg]", ylim=(-20, 20))
    mass.set_title("In the gap the effective mass is negative")


def table(tables):
    def add(quantity, here, closed=""):
        return {"lattice": quantity, "here": float(here), "exact": closed}

    ratio = (stiffness(STIFFENING, 0.0), stiffness(SOFTENING, 0.0))
    first = tables["prisms"]["lower edge [rad/s]"][0]
    yield add("gap of prisms without preload, from [rad/s]", first, float(np.sqrt(2 * min(ratio))))
    yield add("gap of prisms closes at a preload of [N]", closing())
    for q in SHOWN:
        n, own = int(np.argmin(np.abs(DENSITIES - q))), tables["resonators"]
        edges = [own[f"branch {branch} [rad/s]"][n] for branch in ("1 to", "2 from")]
        for side, edge, exactly in zip(("from", "to"), edges, exact(q), strict=True):
            yield add(f"gap of resonators at {q} N/m, {side} [rad/s]", edge, float(exactly))
        frame, inner = FRAME["masses"]
        low, high = exact(q)
        here, middle = resonators(q), (low + high) / 2
        closed = float(frame + inner / (1 - (middle / low) ** 2))
        yield add(
            f"effective mass in the middle of that gap at {q} N/m [kg]", mass(here, middle), closed
        )
        zero = brentq(lambda w, of=here: mass(of, w), middle, 1.1 * high, xtol=1e-13)
        yield add(f"effective mass at {q} N/m is 0 at [rad/s]", zero, float(high))
        fading = np.abs(decay(here, [middle], 0, 0.4).imag).min()
        yield add(f"decay per cell in the middle of that gap at {q} N/m", fading)
    column = STIFFENING.column(periodic=True)
    for w in (0, 1):
        yield add(f"axial stiffness of a column at {w} rad/s [N]", moduli(column, w).axial)
    soft = brentq(lambda w: moduli(column, w).axial, 0.5, 1.0, xtol=1e-13)
    yield add("axial stiffness of a column is 0 at [rad/s]", soft)
    still = bands(column, [[0.0]]).frequencies[0]
    yield add("axial stiffness of a column is infinite at [rad/s]", still[still > soft].min())
    x, long, shear = tables["octahedra"].values()
    ratio = np.interp(0.01, x, shear) / np.interp(0.01, x, long)
    yield add("shear over longitudinal speed of octahedra, strings 1 % shorter", ratio)
