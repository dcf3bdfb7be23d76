"""A band gap rises with amplitude: vibrations at its edges, and of a defect inside it.

Prisms of equal shape join masses in turn light and heavy.  At the lower edge only the heavy masses
move, at the upper one only the light ones, neighbours against each other; a row of cells whose
ends are at rest carries both at any amplitude.  A heavy mass that is too light has a vibration of
its own in the gap.  All are periodic orbits, followed from small to large amplitudes; those at the
edges are also found by quadrature, from one mass between two springs.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import quad

from tensegrity import Chain, Prism, State, dispersion, modes, periodic_orbit

NAME = "structures_gap"
GROUP = "structures"

SPRING = Prism(1.0, 0.7, 0.1, 1.0).potential()
MASSES = 1.0, 3.0  # kg, light and heavy
DEFECT = 2.0  # kg
CELLS = 6
AMPLITUDES = np.geomspace(0.002, 0.05, 12)  # m
EDGES = {"lower edge, heavy masses move": 1, "upper edge, light masses move": 0}


def row(moving):
    """A row whose ends are at rest at sites of the other mass, and its vibration of size 1."""
    sites = 2 * CELLS + 1
    shape = np.zeros(sites)
    shape[1::4], shape[3::4] = 1.0, -1.0
    mass = np.where(np.arange(sites) % 2, MASSES[moving], MASSES[1 - moving])
    return Chain(SPRING, sites, mass, ends=("fixed", "fixed")), shape


def with_defect():
    """A row with a heavy mass that is too light in the middle, and its vibration of size 1."""
    chain, _ = row(1)
    mass = chain.mass.copy()
    middle = 2 * (CELLS // 2) + 1
    mass[middle] = DEFECT
    chain = Chain(SPRING, chain.sites, mass, ends=chain.ends)
    found = modes(chain, count=chain.sites)
    low, high = dispersion(SPRING, MASSES, [np.pi])[0]
    (number,) = np.flatnonzero((found.frequencies > 1.0001 * low) & (found.frequencies < high))
    return chain, found.shapes[number] / found.shapes[number, middle]


def followed(chain, shape, amplitudes=AMPLITUDES):
    """Largest displacements near the given ones [m], angular frequencies [rad/s] and residuals of
    the orbits that start from a vibration of small amplitude."""
    top, found = int(np.abs(shape).argmax()), []
    start = modes(chain, count=chain.sites)
    weight = np.abs(start.shapes @ (chain.mass * shape))
    period = 2 * np.pi / start.frequencies[weight.argmax()]
    guess = State(amplitudes[0] * shape, 0 * shape)
    orbit = periodic_orbit(chain, guess, period=period * (1 - 1e-4))
    for amplitude in amplitudes:  # the energy is nearly as the square
        ratio = amplitude / abs(orbit.state.u[top])
        orbit = periodic_orbit(chain, orbit, energy=orbit.energy * ratio**2)
        found.append([abs(orbit.state.u[top]), 2 * np.pi / orbit.period, orbit.residual])
    return np.array(found).T


def by_quadrature(mass, amplitudes):
    """Angular frequencies of a mass between two springs to masses at rest [rad/s]."""

    def stored(u):
        return float(SPRING.energy(u) + SPRING.energy(-u))

    def speed(angle, size):
        u = size * np.sin(angle)
        return size * np.cos(angle) / np.sqrt(2 / mass * (stored(size) - stored(u)))

    quarter = [quad(speed, 0, np.pi / 2, (size,), epsabs=0, epsrel=1e-9)[0] for size in amplitudes]
    return np.pi / 2 / np.array(quarter)


def data():
    tables = {}
    for name, moving in (*EDGES.items(), ("defect", None)):
        x, w, off = followed(*(with_defect() if moving is None else row(moving)))
        tables[name] = {"amplitude": x, "frequency": w, "residual": off}
        if moving is not None:
            tables[name]["quadrature"] = by_quadrature(MASSES[moving], x)
    return tables


def draw(figure, tables):
    figure.set_size_inches(6.4, 4.2)
    ax = figure.subplots()
    low, high = (tables[name] for name in EDGES)
    x = [1e3 * np.array(of["amplitude"]) for of in (low, high)]
    edge = np.interp(x[0], x[1], high["frequency"])
    ax.fill_between(x[0], low["frequency"], edge, color="0.9")
    names = {name: name for name in EDGES}
    names["defect"] = f"a mass of {DEFECT:g} kg among those of {MASSES[1]:g} kg"
    for k, (name, words) in enumerate(names.items()):
        of = tables[name]
        x = 1e3 * np.array(of["amplitude"])
        ax.plot(x, of["frequency"], f"C{k}")
        ax.plot(x, of.get("quadrature", np.nan * x), ".", color=f"C{k}")
        ax.annotate(words, (4, of["frequency"][0] + (-0.1, 0.12, 0.06)[k]), color=f"C{k}")
    ax.set(xlabel="largest displacement [mm]", ylabel="frequency [rad/s]", ylim=(1.1, 3.0))
    ax.set_title("The gap (grey) rises with amplitude; points: quadrature")


def table(tables):
    return [
        {"vibration": name, "at the smallest amplitude [rad/s]": float(of["frequency"][0]),
         "at the largest": float(of["frequency"][-1]), "residual": float(np.max(of["residual"]))}
        for name, of in tables.items()
    ]  # fmt: skip
