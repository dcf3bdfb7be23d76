"""Bands of lattices, compared with the eigenvalues alone of the same matrices, and with pylatt.

The lattices are plane and triangular with unequal masses, and the octahedra of the catalogue along
a path.  LAPACK gets the matrices ready, in blocks of 64.  pylatt knows no prestress: its lattices
have none, and few wave vectors stand for all.  Processor time, minima over repeats in one run.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmarks._peers import has
from benchmarks._timing import cpu, least, record, table
from benchmarks.packs import STEP as PACK_STEP
from benchmarks.packs import contacts, pack
from tensegrity import Matrix, Record, State, bands, catalogue, simulate
from tensegrity.lattices.bands import bloch_matrix

POINTS, BLOCK, FEW, REPEATS, STEPS = 1000, 64, 10, 5, 400
MESHED, BRANCHES = 100, 12  # wave vectors and branches in a matrix
SHAPES = ((4, 3), (5, 4), (6, 6), (10, 6))
NAMED = {"shapes": np.linalg.eigh, "frequencies": np.linalg.eigvalsh}


def triangular(shape):
    """A cell of several nodes of unequal masses."""
    cell = catalogue.triangular(k_bar=1.0).repeated(shape)
    return cell.at_mass(1 + 0.5 * np.sin(np.arange(cell.nodes)))


def in_pylatt(lattice):
    """The same lattice as one of pylatt's."""
    import pylatt

    nodes = [pylatt.Node(x, m) for x, m in zip(lattice.positions, lattice.mass, strict=True)]
    ends = lattice.positions[lattice.ends[:, 1]] + lattice.offsets @ lattice.vectors
    beams = [
        pylatt.Beam(lattice.positions[i], end, k)
        for i, end, k in zip(lattice.ends[:, 0], ends, lattice.stiffnesses, strict=True)
    ]
    return pylatt.Truss(lattice.vectors, nodes, beams)


def over_pylatt(lattice, phases, ours):
    """Its time for all wave vectors over ours, and the largest difference of squared frequencies
    over the largest."""
    peer = in_pylatt(lattice)
    waves = phases[:FEW] @ np.linalg.inv(lattice.vectors).T
    theirs = least(lambda: peer.compute_bands(waves), 1)[0] * len(phases) / FEW
    own = bands(lattice, phases[:FEW]).frequencies
    gap = np.abs(np.asarray(peer.compute_bands(waves)) ** 2 - own**2).max() / (own**2).max()
    return theirs / ours, gap


def step_cost(scene, state, dt):
    """Processor time of a verlet step [s], the start of a call apart."""
    found = []
    for count in (STEPS, 6 * STEPS):
        record = Record(every=count)
        call = partial(simulate, scene, state, count * dt, dt=dt, method="verlet", record=record)
        call()
        found.append(least(call, REPEATS)[0])
    return (found[1] - found[0]) / (5 * STEPS)


def motion():
    """A lattice of 5,184 nodes and the pack of the talk: a member compared with a contact."""
    lattice = catalogue.octahedra(k_bar=20.0).network((6, 6, 6))
    u = np.random.default_rng(0).normal(size=lattice.shape) * 1e-4
    u[list(lattice.held)] = 0.0
    beads = pack()
    member = step_cost(lattice, State(u, 0 * u), 0.01) / len(lattice.bonds)
    contact = step_cost(beads, beads.start(), PACK_STEP) / contacts(beads)
    record("lattices", "octahedra in motion", "a member over a contact", member, contact)
    print(f"\n{lattice}: {1e9 * member:.2f} ns a member and step, the pack {1e9 * contact:.2f} ns")
    print(f"a contact and step, ratio {member / contact:.2f}")


def embedded(points=MESHED):
    """The lowest waves of a lattice in 1,936 elements, also by SciPy on ready matrices."""
    from scipy.sparse.linalg import eigsh

    cell = catalogue.square().embedded(Matrix(3.0, 0.3, 0.5, radius=0.2), mesh=22)
    phases = np.random.default_rng(2).uniform(0.1, np.pi, (points, 2))
    matrix = bloch_matrix(cell, sparse=True)
    weights = matrix.weights(phases)
    ready = [(matrix.at(one), matrix.at(one, matrix.inertia)) for one in weights]
    rivals = {
        "ours": lambda: bands(cell, phases, count=BRANCHES),
        "eigsh": lambda: [eigsh(k, BRANCHES, m, sigma=-1e-3)[0] for k, m in ready],
    }
    times = cpu(rivals, 1)
    gap = np.abs(np.array([np.sort(w) for w in rivals["eigsh"]()]) ** 0.5
                 / rivals["ours"]().frequencies - 1).max()  # fmt: skip
    record("lattices", "in a matrix, 1,936 elements", "over eigsh", times["ours"], times["eigsh"])
    print(f"\nIn a matrix of 1,936 elements, {BRANCHES} branches at {points} wave vectors: ours")
    print(f"{times['ours']:.2f} s, eigsh {times['eigsh']:.2f} s, ratio", end=" ")
    print(f"{times['ours'] / times['eigsh']:.2f}; frequencies differ by {gap:.1e}")


def main():
    motion()
    embedded()
    generator = np.random.default_rng(1)
    cases = {
        f"{n * m} nodes": (triangular((n, m)), generator.uniform(-np.pi, np.pi, (POINTS, 2)))
        for n, m in SHAPES
    }
    line = np.linspace(0.01, np.pi, 400)[:, None] * [1.0, 0.5, 0.2]
    cases["octahedra, 24 nodes"] = (catalogue.octahedra(k_bar=20.0), line)
    peer, rows = has("pylatt"), []
    for name, (lattice, phases) in cases.items():
        matrix = bloch_matrix(lattice)
        ready = matrix.at(matrix.weights(phases))
        blocks = [ready[k : k + BLOCK] for k in range(0, len(ready), BLOCK)]
        row = [name]
        for kind, solver in NAMED.items():
            shapes = kind == "shapes"
            rivals = {
                "ours": lambda s=shapes: bands(lattice, phases, shapes=s),  # noqa: B023
                "LAPACK": lambda f=solver: [f(block) for block in blocks],  # noqa: B023
            }
            times = cpu(rivals, REPEATS)
            record("lattices", f"{name}, {kind}", "over LAPACK", times["ours"], times["LAPACK"])
            row += [f"{1e3 * times['ours']:.0f}", f"{times['ours'] / times['LAPACK']:.2f}"]
        if peer and lattice.dim == 2:
            ratio, gap = over_pylatt(lattice, phases, times["ours"])
            record("lattices", name, "over pylatt", 1.0, ratio)
            row += [f"{ratio:.0f}", f"{gap:.1e}"]
        rows.append(row + ["-"] * (7 - len(row)))
    columns = ["lattice", "shapes [ms]", "over eigh", "w [ms]", "/eigvalsh",
               "pylatt", "difference"]  # fmt: skip
    table(f"Bands at {POINTS} wave vectors (octahedra: 400)", columns, rows)
