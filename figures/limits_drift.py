"""In ten million steps rk4 loses a third of the energy; symplectic methods lose none."""

import numpy as np

from figures._draw import name_curves
from figures._limits import COLOURS, grid, prism_chain
from tensegrity import METHODS, State
from tensegrity.scenes.dynamics import dynamics

GROUP = "limits"

SITES = 3
BLOW = (1e-3, -3e-4, -7e-4)  # m/s: so slow that the modes of the linear chain predict the loss
STEP = 0.2  # dt * omega_max of the classical method
STEPS = 10_000_000  # of it
WORK = {"rk4": 1.0, "verlet": 1.0, "rkn6": 0.2}  # steps of each over these
LOOKS = 60


def scene():
    """Chain, state, and the frequencies of its modes with the energy in each."""
    chain = prism_chain(SITES)
    state = chain.at_rest(dict(enumerate(BLOW)))
    stiffness = float(chain.springs[0].stiffness(0.0))
    number = np.arange(SITES)
    frequencies = 2 * np.sqrt(stiffness) * np.sin(np.pi * number / (2 * SITES))
    shapes = np.cos(np.pi * np.outer(number, number + 0.5) / SITES)
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    return chain, state, frequencies, 0.5 * (shapes @ state.v) ** 2


def looks(steps):
    """Numbers of steps at which the energy is evaluated."""
    return np.unique(np.geomspace(100, steps, LOOKS).astype(int))


def drifting(method, steps, dt):
    """Relative change of the energy after numbers of steps, in the bare loop."""
    chain, state, *_ = scene()
    u, v = dynamics(chain).arrays(state)
    loop = dynamics(chain).bind(u, v, METHODS[method], dt)
    first, done, found = chain.energy(state), 0, []
    for stop in looks(steps).tolist():
        loop.advance(stop - done)
        done = stop
        found.append(chain.energy(State(u, v)) / first - 1)
    return {"time [s]": looks(steps) * dt, "change of the energy": np.array(found)}


def predicted(method, steps, dt):
    """That change predicted by the eigenvalues of a step in each mode of the linear chain."""
    _, _, frequencies, energies = scene()
    xx, xv, vx, vv = METHODS[method].step_matrix(frequencies[1:] * dt)
    factor = xx * vv - xv * vx  # of the energy in a mode, per step
    grown = energies[1:] * np.exp(np.outer(looks(steps), np.log(factor)))
    return (energies[0] + grown.sum(axis=1)) / energies.sum() - 1


def data(steps=STEPS):
    """Change of the energy of each method over the same time."""
    dt = STEP / scene()[2].max()
    tables = {name: drifting(name, int(steps * part), dt / part) for name, part in WORK.items()}
    tables["rk4"]["predicted"] = predicted("rk4", steps, dt)
    return tables


def text(tables):
    """The section of the page."""
    change = {name: tables[name]["change of the energy"] for name in WORK}
    rows = [[name, f"{STEP / part:g}", f"{STEPS * part:.0e}", f"{np.abs(change[name]).max():.1e}"]
            for name, part in WORK.items()]  # fmt: skip
    head = ["method", "dt omega_max", "steps", "largest change of the energy, relative"]
    return (
        f"After {STEPS:.0e} steps rk4 has lost {-change['rk4'][-1]:.1%} of the energy of a small "
        f"chain; the eigenvalues of a step predict {-tables['rk4']['predicted'][-1]:.1%}. The "
        f"errors of symplectic methods oscillate and do not accumulate.\n\n{grid(head, rows)}"
    )


def draw(figure, tables):
    """Size of the change of energy against time."""
    axes = figure.subplots()
    for name in WORK:
        t, change, *_ = tables[name].values()
        axes.loglog(t, np.abs(change), "o", ms=3, color=COLOURS[name], label=name)
    t = tables["rk4"]
    axes.loglog(t["time [s]"], -t["predicted"], "k--", lw=1)
    axes.set(xlabel="time [s]", ylabel="relative change of the energy")
    axes.annotate("line: as the eigenvalues of a step predict", (3e2, 1e-4), va="top")
    name_curves(axes)
