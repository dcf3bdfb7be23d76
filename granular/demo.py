"""`python -m tensegrity demo`: a prism compressed, a chain struck and a pack struck, in seconds.

It prints computed numbers with their errors relative to independent results, and writes
`tensegrity-demo.png` and `tensegrity-demo.gif` into the working folder.  The exit code is 0 if all
errors are below their bounds, otherwise 1.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from granular.beads import Bead, Striker, materials
from granular.lattices import hexagonal_pack
from granular.observables import wall_force
from tensegrity import (
    Chain,
    Prism,
    Record,
    Run,
    SolitaryWave,
    arrival,
    check,
    equilibrium_path,
    largest_peak,
    plotting,
    simulate,
    solitary_wave,
    speed,
)
from tensegrity.notebook import progress

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

    from tensegrity.prisms.problem import EquilibriumPath

FRAMES, RATE = 40, 12
INTERRUPTED = 130  # exit code, as of a shell
UNDER = 1.8  # order of what is drawn once: over the axes, under all that moves
SITES, TIMED, SEEN = 60, 40, 6  # bond where the arrival is measured; bonds drawn around it
MAGNIFIED, FASTEST = 60, 0.15  # factor of drawn displacements; m/s, end of the colours


class Demo(NamedTuple):
    """Paths of an elastic and of a rigid prism; a run of a chain, the exact wave with the speed of
    its leading pulse, and the time at which that passes bond `TIMED` [s]; a run of a pack."""

    elastic: EquilibriumPath
    rigid: EquilibriumPath
    chain: Run
    wave: SolitaryWave
    passed: float
    pack: Run

    def peak(self, row: int) -> float:
        """Position of the peak of the exact wave [bonds], at a row of the run of the chain."""
        return float(TIMED + self.wave.speed * (self.chain.t[row] - self.passed))


def computed() -> Demo:
    """All runs of the demonstration; a bar counts them, in a terminal."""
    rigid = Prism(base=1.0, height=0.5, prestrain=0.1, k_cross=1.0)
    elastic = Prism(base=1.0, height=0.5, prestrain=0.1, k_cross=1.0, k_base=5.0, k_bar=50.0)
    spring = Prism(base=1.0, height=0.7, prestrain=0.01, k_cross=1.0).potential()
    chain = Chain(spring, SITES)
    blow, dense = chain.at_rest({0: 0.07}), Record(interval=0.02)
    steel, soft = materials["steel"], materials["ptfe"]
    bead = Bead(9.53e-3, steel)
    striker = Striker(bead, speed=1.0)
    pack = hexagonal_pack(12, 21, bead=bead, floor=steel, sides=soft, striker=striker)
    with progress(4, "result") as bar:
        paths = equilibrium_path(elastic), equilibrium_path(rigid)
        bar.update()
        struck = simulate(chain, blow, t_end=48.0, tol=1e-8, record=dense)
        bar.update()
        wave = solitary_wave(spring, speed=speed(struck, (TIMED - 15, TIMED)))
        bar.update()
        hit = simulate(pack, pack.start(), t_end=3e-4, tol=1e-8, record=Record(interval=4e-7))
        bar.update()
    return Demo(*paths, struck, wave, arrival(struck, TIMED), hit)


def checks(demo: Demo) -> list[tuple[str, float, float]]:
    """Each result in words, its error and the bound of the error."""
    elastic, rigid, wave, pack = demo.elastic, demo.rigid, demo.wave, demo.pack
    fold = next(event for event in elastic.events if event.kind == "fold")
    left = float(elastic.prism.potential().stiffness(-fold.shortening))
    lock = rigid.prism.locking_height()
    bonds = np.arange(round(demo.peak(-1)) - SEEN, SITES - 1)
    off = np.diff(demo.chain.final.u)[bonds] - wave.elongation(bonds - demo.peak(-1))
    at, force = largest_peak(pack.t, wall_force(pack, "floor"))
    prism = f"prism  limit load {fold.load:.6f} N, where the potential has zero stiffness"
    rigid_one = f"       locking height {lock:.6f} m with rigid members, in closed form"
    chain = f"chain  leading wave at {wave.speed_ratio:.4f} sound speeds, equal to the exact wave"
    beads = f"pack   {force:.2f} N on the floor after {1e6 * at:.0f} us; energy is conserved"
    return [
        (prism, abs(left) / elastic.prism.axial_stiffness(), 1e-9),
        (rigid_one, abs(float(rigid.height[-1]) / lock - 1), 1e-6),
        (chain, float(np.abs(off).max()) / abs(wave.amplitude), 1e-5),
        (beads, pack.energy_error, 1e-8),
    ]


def draw(figure: Figure, demo: Demo) -> Callable[[float], list[Artist]]:
    """Draw all three; returns a function that shows the instant at a fraction of the time, and
    returns what it has changed."""
    from matplotlib.collections import EllipseCollection

    press, strike, hit = figure.subplots(1, 3, width_ratios=(1, 1.2, 1.2))
    rigid, soft = ((path.shortening, path.load) for path in (demo.rigid, demo.elastic))
    press.plot(*rigid, label="rigid bases and bars: locking", zorder=UNDER)
    press.plot(*soft, label="elastic ones: snap-through at the limit load", zorder=UNDER)
    (state,) = press.plot([], [], "C1o")
    press.set(xlabel="shortening [m]", ylabel="load [N]", ylim=(0, 0.4))
    press.set_title("A prism is compressed")
    (exact,) = strike.plot([], [], "C1", lw=3, alpha=0.6, label="exact wave of the same speed")
    (sites,) = strike.plot([], [], "C0.-", lw=0.8, label=f"chain of {SITES} prisms")
    strike.set(xlabel="bond", ylabel="compression [m]", xlim=(0, SITES))
    strike.set_title("A chain is struck at its first site")
    strike.set_ylim(-0.01, 1.5 * abs(demo.wave.amplitude))
    press.legend(fontsize=8, loc="upper right").set_zorder(UNDER)
    strike.legend(fontsize=8, loc="upper left").set_zorder(UNDER)  # nothing moves there
    places, u, v = demo.pack.scene.positions, demo.pack.u, demo.pack.v
    size = [1e3 * bead.diameter for bead in demo.pack.scene.beads]
    on, colours = hit.transData, {"cmap": "inferno_r", "clim": (0, FASTEST), "edgecolors": "0.4"}
    beads = EllipseCollection(size, size, 0, units="xy", offset_transform=on, lw=0.3, **colours)
    beads.set_zorder(2)
    hit.add_collection(beads)
    (left, low), (right, high) = 1e3 * places.min(axis=0), 1e3 * places.max(axis=0)
    hit.set(xlim=(left - 6, right + 6), ylim=(low - 6, high + 6), aspect="equal", xlabel="x [mm]")
    hit.set(ylabel="z [mm]", title=f"A pack is struck; motion magnified {MAGNIFIED} times")
    figure.colorbar(beads, ax=hit, label="speed of a bead [m/s]", shrink=0.7, extend="max")
    x = np.linspace(-SEEN, SEEN, 20 * SEEN)

    def show(part: float) -> list[Artist]:
        step, row, k = (round(part * (len(one) - 1)) for one in (soft[0], demo.chain.t, u))
        state.set_data([soft[0][step]], [soft[1][step]])
        sites.set_data(range(SITES - 1), -np.diff(demo.chain.u[row]))
        exact.set_data(demo.peak(row) + x, -demo.wave.elongation(x))
        beads.set_offsets(1e3 * (places + MAGNIFIED * u[k]))
        beads.set_array(np.linalg.norm(v[k], axis=1))
        return [state, sites, exact, beads]

    return show


def main() -> int:
    """Run the demonstration; returns the exit code."""
    try:
        return _main()
    except KeyboardInterrupt:
        print("interrupted; what is named above is done")
        return INTERRUPTED


def _main() -> int:
    from matplotlib.figure import Figure

    demo, failed = computed(), 0
    for words, error, bound in checks(demo):
        failed += not error <= bound  # also where the error is NaN
        print(f"{words}: {'error' if error <= bound else 'WRONG, error'} {error:.1e}", flush=True)
    figure = Figure(figsize=(15, 4.2), dpi=80, layout="constrained")
    show = draw(figure, demo)
    picture, film = (Path(f"tensegrity-demo.{kind}") for kind in ("png", "gif"))
    show(0.8)
    with check.replacing(picture) as new:
        figure.savefig(new, dpi=110)
    figure.set_layout_engine("none")  # the film is laid out as the picture
    print(f"{picture}: all three scenes, at one instant", flush=True)
    plotting.film(film, figure, np.linspace(0.02, 1, FRAMES).tolist(), show, RATE)
    print(f"{film}: and animated")
    return int(failed > 0)
