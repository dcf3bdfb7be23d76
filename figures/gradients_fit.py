"""Identification of the prisms of a chain from a noisy record of one site.

Ten prisms of unequal stiffness; the displacement of one site, with 2 % of noise, is all that is
known.  Each sample is an objective of one backward pass, so that a single pass gives the whole
Jacobian; Gauss-Newton steps follow, and the Jacobian yields standard deviations.  Its singular
values also show what a record cannot determine: of stiffness and mass only the ratio, since scaling
both together changes no displacement.
"""

from __future__ import annotations

import numpy as np

from figures import _gradients
from tensegrity import Chain, Prism, gradient
from tensegrity import objective as o

NAME = "gradients_fit"
GROUP = "gradients"

PRISMS, SITE, SPEED, PRESTRAIN = 10, 5, 0.05, 0.02
DT, END, SAMPLES, METHOD = 0.25, 60.0, 60, "rkn6"
NOISE, STEPS = 0.02, 8
LEAST = 1e-8  # of the largest singular value: directions below are not identifiable


def chain(k, mass=1.0):
    """The chain with the given stiffnesses of its cross strings."""
    springs = [Prism(1.0, 0.7, PRESTRAIN, x).potential() for x in k]
    return Chain(springs, PRISMS + 1, mass, ("free", "fixed"))


def traced(scene):
    """The record, and its derivatives by log k of every prism and by log of all masses."""
    at = np.linspace(0, END, SAMPLES + 1)[1:]
    places = np.rint(at / DT).astype(int)
    samples = [_gradients.sample(o.displacement(SITE), k) for k in places]
    state = scene.at_rest({0: SPEED})
    rows = gradient(samples, scene, state, END, dt=DT, method=METHOD, wanted=("k_cross",))
    k = np.array([spring.parameters["k_1"] for spring in scene.springs])
    by_k = np.array([g.by("k_cross") * k for g in rows])
    by_mass = np.array([[g.mass @ scene.mass] for g in rows])
    return at, np.array([g.value for g in rows]), by_k, by_mass


def data():
    """True and estimated stiffnesses with their deviations, and both sets of singular values."""
    rng = np.random.default_rng(3)
    true = np.exp(rng.uniform(-0.2, 0.2, PRISMS))
    at, clean, _, _ = traced(chain(true))
    deviation = NOISE * np.sqrt(np.mean(clean**2))
    noisy = clean + deviation * rng.standard_normal(SAMPLES)
    x, misfits = np.zeros(PRISMS), []
    for _ in range(STEPS):
        _, found, by_k, _ = traced(chain(np.exp(x)))
        short = noisy - found
        misfits.append(float(np.sqrt(np.mean(short**2))))
        step = np.linalg.lstsq(by_k, short, rcond=LEAST)[0]
        x = x + step * min(1.0, 0.3 / np.abs(step).max())
    _, found, by_k, by_mass = traced(chain(np.exp(x)))
    unsure = np.sqrt(np.diag(np.linalg.inv(by_k.T @ by_k))) * deviation
    alone = np.linalg.svd(by_k / deviation, compute_uv=False)
    both = np.linalg.svd(np.hstack([by_k, by_mass]) / deviation, compute_uv=False)
    return {
        "record": {"t": at, "noisy": noisy, "found": found},
        "prisms": {"prism": np.arange(PRISMS), "true": true, "found": np.exp(x),
                   "deviation": unsure * np.exp(x)},
        "singular": {"number": np.arange(PRISMS + 1), "k": alone, "k and mass": both},
        "misfit": {"step": np.arange(STEPS), "misfit": misfits},
    }  # fmt: skip


def table(tables):
    """The error of the estimate, and what the record cannot determine."""
    prisms, singular = tables["prisms"], tables["singular"]
    off = (np.asarray(prisms["found"]) - prisms["true"]) / prisms["deviation"]
    both = np.asarray(singular["k and mass"])
    rows = {
        "rms error of k over its deviation": float(np.sqrt(np.mean(off**2))),
        "largest deviation of k": float(np.max(prisms["deviation"])),
        "singular values, k alone": " ".join(f"{s:.2g}" for s in singular["k"]),
        "singular values, k and mass": " ".join(f"{s:.2g}" for s in both),
        "k and mass together": "not identifiable: displacements depend on k/m only"
        if both[-1] < LEAST * both[0] else "both identifiable",
    }  # fmt: skip
    return [{"picture": NAME, "quantity": k, "value": v} for k, v in rows.items()]


def draw(figure, tables):
    """The record and its fit, the stiffnesses, the singular values."""
    figure.set_size_inches(12, 4)
    left, middle, right = figure.subplots(1, 3)
    record, prisms, singular = tables["record"], tables["prisms"], tables["singular"]
    left.plot(record["t"], record["noisy"], ".", color="0.4", label="record")
    left.plot(record["t"], record["found"], color="C0", lw=1, label="fit")
    left.set(xlabel="time [s]", ylabel=f"displacement of site {SITE} [m]")
    left.legend(loc="upper left")
    middle.plot(prisms["prism"], prisms["true"], "kx", label="true")
    middle.errorbar(prisms["prism"], prisms["found"], prisms["deviation"], fmt="o", ms=4,
                    color="C0", label="estimate ± one deviation")  # fmt: skip
    middle.set(xlabel="prism", ylabel="k_cross [N/m]")
    middle.margins(y=0.25)
    middle.legend(loc="upper center")
    for name, mark in (("k", "o-"), ("k and mass", "s--")):
        right.semilogy(np.arange(len(singular[name])), singular[name], mark, ms=4, label=name)
    right.set(xlabel="number", ylabel="singular value [deviations per unit of log]")
    right.legend(loc="lower left")
