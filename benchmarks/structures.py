"""Force densities and towers against tnsgrt, modes against eigvalsh, a path against SciPy's root,
and steps of structures whose members have mass against those with masses at the nodes alone.

Where tnsgrt is not installed or does not import, its columns are left out and that is printed.
Times are minima of processor time over repeats in one run.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmarks import _against
from benchmarks._timing import least, record, table
from tensegrity import (
    Prism,
    Record,
    State,
    Structure,
    Wall,
    catalogue,
    equilibrium,
    equilibrium_path,
    held,
    plates,
    simulate,
)
from tensegrity.engine import methods
from tensegrity.scenes.dynamics import dynamics

STAGES = (10, 100, 1000)
SMALL = (2, 8, 16, 32)  # stages of towers whose modes are found from the full matrix
OFTEN = 30
BEFORE = "9746a0f0"
MEMBERS = 300_000  # member evaluations of a timed advance
PRISM = Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0)
BALL = {"lower": (0, 4, 8), "upper": (3, 7, 11)}


def in_tnsgrt(s):
    """A structure as one of tnsgrt's, strings first as there, and that order; None without it."""
    if not hasattr(np, "float_"):
        setattr(np, "float_", np.float64)  # noqa: B010 - a name of NumPy 1 that its annotations use
    try:
        from tnsgrt.structure import Structure as Other
    except Exception as error:  # any failure to import is reported, none stops the benchmark
        print(f"tnsgrt left out: {type(error).__name__}: {error}")
        return None
    bars = s.bars
    order = np.concatenate([np.arange(bars, len(s.ends)), np.arange(bars)])
    other = Other(s.positions.T.copy(), s.ends[order].T.copy(), len(s.ends) - bars)
    other.member_properties["lambda_"] = s.densities[order]
    other.member_properties["stiffness"] = s.stiffnesses[order]
    return other, order


def densities():
    """Force densities by linear programming of structures with one state of self-stress."""
    from figures.structures_icosahedron import icosahedron

    shapes = {"icosahedron": icosahedron()}
    for sides in (3, 4, 5, 8):
        shapes[f"prism of {sides} sides"] = Prism(
            1.0, 1.0, 0.1, 1.0, 5.0, 50.0, sides=sides
        ).structure()
    for name, s in shapes.items():
        seconds, own = least(lambda s=s: s.self_stress().feasible)
        line = f"{name}: force densities {1e3 * seconds:.3g} ms"
        found = in_tnsgrt(s)
        if found is not None:
            other, order = found
            try:
                other_seconds, _ = least(other.equilibrium)
                theirs = np.empty(len(order))
                theirs[order] = other.member_properties["lambda_"].to_numpy(float)
                own = own / -np.mean(own[: s.bars])  # as theirs: -1 for bars on average
                gap = np.abs(own - theirs).max() / np.abs(own).max()
                exact = s.densities / -np.mean(s.densities[: s.bars])
                far = [np.abs(q - exact).max() / np.abs(exact).max() for q in (own, theirs)]
                line += f"; tnsgrt {1e3 * other_seconds:.3g} ms, largest difference {gap:.2g}; "
                line += f"from the prestress of the shape {far[0]:.2g} and {far[1]:.2g}"
            except Exception as error:  # its interface may be another one: said, not hidden
                line += f"; tnsgrt failed: {type(error).__name__}: {error}"
        print(line, flush=True)


def towers():
    """Tangent and six modes of towers: times, and the largest differences from tnsgrt."""
    for stages in STAGES:
        s = PRISM.column(stages)
        seconds, matrix = least(s.stiffness)
        modes_seconds, modes = least(lambda s=s: s.modes(6))
        line = f"{stages} stages, {s.nodes} nodes: tangent {1e3 * seconds:.3g} ms, "
        line += f"6 modes {1e3 * modes_seconds:.3g} ms"
        found = in_tnsgrt(s) if stages <= 100 else None
        if found is not None:
            try:
                line += beside(found[0], seconds, matrix, modes_seconds, modes)
            except Exception as error:  # its interface may be another one: said, not hidden
                line += f"; tnsgrt failed: {type(error).__name__}: {error}"
        print(line, flush=True)


def small_towers():
    """Six modes of towers of up to 99 nodes, from the members on, beside the eigenvalues alone of
    the full matrix that `numpy.linalg.eigvalsh` is given.  A structure knows from its first call on
    which motions are rigid, and where in the matrix each member goes."""
    for stages in SMALL:
        s = PRISM.column(stages)
        full = s.stiffness().toarray()
        others = iter([s.at(s.positions) for _ in range(OFTEN)])
        first, _ = least(lambda others=others: next(others).modes(6), OFTEN)
        seconds, modes = least(lambda s=s: s.modes(6), OFTEN)
        other, values = least(lambda full=full: np.linalg.eigvalsh(full), OFTEN)
        record("modes", f"{s.nodes} nodes", "over eigvalsh", seconds, other)
        gap = np.abs(values[6:12] - modes.eigenvalues).max() / values[-1]
        print(
            f"{s.nodes} nodes: 6 modes {1e3 * seconds:.3g} ms, eigvalsh {1e3 * other:.3g} ms, "
            f"ratio {seconds / other:.3g}, at the first call {first / other:.3g}, "
            f"largest difference {gap:.2g} of the largest eigenvalue"
        )


def beside(peer, seconds, matrix, modes_seconds, modes):
    """Times of tnsgrt over these, and largest differences; its modes are dense."""
    other_seconds, other = least(lambda: peer.stiffness()[0].K)
    other = other.toarray() if hasattr(other, "toarray") else np.asarray(other)
    gap = np.abs(other - matrix.toarray()).max() / np.abs(other).max()
    slow, values = least(
        lambda: peer.stiffness(storage="dense", apply_rigid_body_constraint=True)[0].eigs()[0]
    )
    far = np.abs(values[:6] - modes.eigenvalues).max() / np.abs(other).max()
    return (
        f"; tnsgrt {1e3 * other_seconds:.3g} and {1e3 * slow:.3g} ms, ratios "
        f"{other_seconds / seconds:.3g} and {slow / modes_seconds:.3g}, largest differences "
        f"{gap:.2g} and {far:.2g} of the largest entry"
    )


def ball_path():
    """Loads of the icosahedron along its symmetric path up to the slack corner, both ways."""
    from scipy.optimize import root

    from figures.structures_icosahedron import icosahedron

    s = icosahedron()
    held = plates(BALL["lower"], BALL["upper"])
    seconds, path = least(
        lambda: equilibrium_path(s, supports=held, branch="symmetric", max_shortening=0.85), OFTEN
    )
    freedom = s.freedom(held)
    motions = np.asarray(freedom.motions @ freedom.complement())
    pattern = np.zeros((12, 3))
    pattern[list(BALL["upper"]), 2] = -1 / 3
    along = motions.T @ pattern.ravel()
    places = path.shortening

    def by_roots():
        x, loads = np.zeros(motions.shape[1] + 1), []
        for place in places:

            def gap(u, place=place):
                at = s.positions + (motions @ u[:-1]).reshape(12, 3)
                force = motions.T @ s.members.gradient(at).ravel() - u[-1] * along
                return np.append(force, along @ u[:-1] - place)

            def slope(u):
                at = s.at(s.positions + (motions @ u[:-1]).reshape(12, 3))
                inner = motions.T @ (at.stiffness() @ motions)
                return np.block([[inner, -along[:, None]], [along, np.zeros(1)]])

            x = root(gap, x, jac=slope, method="lm", options={"xtol": 1e-14, "ftol": 1e-14}).x
            loads.append(x[-1])
        return np.array(loads)

    other, loads = least(by_roots)
    record("path", "icosahedron", "over root solves", seconds, other)
    print(
        f"icosahedron, {len(places)} equilibria: path {seconds:.3g} s, "
        f"{1e3 * seconds / len(places):.3g} ms each, root solves {other:.3g} s, "
        f"ratio {other / seconds:.3g}, largest difference {np.abs(loads - path.load).max():.2g} N"
    )


def chains():
    """Hanging chains of steel, over the commit before strings settled in tensions."""
    found = _against.against(BEFORE, _against.CABLES, rounds=2)
    rows = [[name, *pair, pair[0] / pair[1]] for name, pair in found.items()]
    table(f"hanging [us], against {BEFORE}", ["", "here", "there", "ratio"], rows, ["ratio"])


def cable_net(sides=31):
    """A flat net of steel strings on a square border, 2 % too long, and the weight that it takes:
    the structure, loads and supports."""
    grid = np.arange((sides + 1) ** 2).reshape(sides + 1, -1)
    places = np.column_stack([*np.divmod(grid.ravel(), sides + 1), 0 * grid.ravel()]).astype(float)
    inner = set(grid[1:-1, 1:-1].ravel().tolist())
    pairs = [
        *zip(grid[:-1].ravel().tolist(), grid[1:].ravel().tolist(), strict=True),
        *zip(grid[:, :-1].ravel().tolist(), grid[:, 1:].ravel().tolist(), strict=True),
    ]
    pairs = [pair for pair in pairs if inner & set(pair)]
    used = sorted({k for pair in pairs for k in pair})
    number = {k: n for n, k in enumerate(used)}
    strings = [(number[i], number[j]) for i, j in pairs]
    net = Structure(places[used], strings=strings, k_string=1e7 / 1.02,
                    natural_lengths=[1.02] * len(strings))  # fmt: skip
    fixed = [number[k] for k in used if k not in inner]
    return net, {number[k]: (0.0, 0.0, -1.0) for k in inner}, held(fixed)


def net():
    """Steps and time of the equilibrium of 1,860 steel strings, over a sparse solve."""
    from tensegrity.minimum import downhill
    from tensegrity.structures import settling

    s, loads, supports = cable_net()
    steps, step = [], settling.LoadedMembers.newton_with
    settling.LoadedMembers.newton_with = lambda *given: steps.append(1) or step(*given)
    try:
        state = equilibrium(s, loads, supports)
    finally:
        settling.LoadedMembers.newton_with = step
    motions = s.freedom(supports).motions
    tangent = motions.T @ (state.structure.stiffness() @ motions)
    force, rigid = motions.T @ np.ones(s.positions.size), np.zeros((motions.shape[1], 0))
    solve, _ = least(lambda: downhill(tangent, rigid, force), OFTEN)
    seconds, _ = least(lambda: equilibrium(s, loads, supports))
    each = seconds / len(steps)
    record("net", f"{len(s.ends)} strings", "step over solve", each, solve)
    print(f"net of {len(s.ends)} strings: {len(steps)} Newton steps, one {each / solve:.3g} solves")


def landing():
    """A fall of 12 nodes on a floor over the same steps of the network without one."""
    from figures.structures_landing import DT, FLOOR, GRAVITY, dropped

    s = dropped(0.5)
    walls = {"walls": [Wall((0, 0, 0), (0, 0, 1))], "wall_law": FLOOR}
    scenes = [s.network(**given, gravity=GRAVITY) for given in (walls, {})]
    ends = Record(times=[0.0, 0.6])
    times = [
        least(lambda x=x: simulate(x, x.at_rest(), 0.6, method="rkn6", dt=DT, record=ends), 7)
        for x in scenes
    ]
    (ours, _), (bare, _) = times
    record("landing", f"{s.nodes} nodes", "over no floor", ours, bare)
    print(f"landing of {s.nodes} nodes: {ours / bare:.3g} times the run without a floor")


def heavy_members():
    """Verlet steps of structures with the mass in bars, or in all members, over those of the same
    with all masses at the nodes: the loop alone, alternately."""
    shapes = {
        "prism": PRISM.structure(),
        "octahedron": catalogue.expandable_octahedron(),
        "30-bar sphere": catalogue.geodesic(),
        "tower of 300 nodes": PRISM.column(99),
    }
    for name, s in shapes.items():
        cases = {"lumped": {}, "bars": {"bar_mass": 1.0, "mass": 0.1},
                 "all members": {"bar_mass": 1.0, "string_mass": 0.1, "mass": 0.1}}  # fmt: skip
        loops, steps = {}, MEMBERS // len(s.ends)
        for case, given in cases.items():
            net = s.at(s.positions, **given).network()
            v = 1e-3 * np.random.default_rng(0).normal(size=net.shape)
            arrays = dynamics(net).arrays(State(np.zeros(net.shape), v))
            loops[case] = dynamics(net).bind(*arrays, methods.METHODS["verlet"], 1e-3)
        best = dict.fromkeys(loops, np.inf)
        for _ in range(OFTEN):
            for case, loop in loops.items():
                best[case] = min(best[case], least(partial(loop.advance, steps), 1)[0])
        for case in ("bars", "all members"):
            record("steps", f"{name}, mass in {case}", "over lumped", best[case], best["lumped"])
        print(
            f"{name}: {1e9 * best['lumped'] / steps:.0f} ns a step, with mass in bars "
            f"{best['bars'] / best['lumped']:.3g}, in all members "
            f"{best['all members'] / best['lumped']:.3g} times that"
        )


def main():
    heavy_members()
    densities()
    landing()
    chains()
    net()
    ball_path()
    small_towers()
    towers()


if __name__ == "__main__":
    main()
