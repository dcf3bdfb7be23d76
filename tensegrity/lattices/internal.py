"""Internal motions: how the nodes of a cell follow forces at a frequency, (K - w^2 M) u = f.

Rows and columns are scaled by the roots of their stiffness plus inertia, so that masses and springs
of very different sizes keep their digits.  An eigenvalue of the scaled matrix that is round-off
belongs to a motion without stiffness, or to one that resonates; it is left out, and is reported
where the forces work on it.
"""

from __future__ import annotations

import numpy as np

from tensegrity.minimum import ZERO
from tensegrity.typing import Array, Flags

WORK = 1e-7  # force on a motion without stiffness that counts as zero, over what it could be


def internal_motions(
    stiffness: Array, mass: Array, frequencies: Array, forces: Array, largest: Array
) -> tuple[Array, Flags, Array]:
    """Motions of the nodes under forces.

    Parameters
    ----------
    stiffness : ndarray, (size, size)
        [N/m]
    mass : ndarray, (size,)
        Of each coordinate [kg].
    frequencies : ndarray, (...)
        Angular frequencies [rad/s].
    forces, largest : ndarray, (size, count)
        Forces, and the sums of the sizes of their parts, which may cancel [N].

    Returns
    -------
    motions : ndarray, (..., size, count)
        [m]; without momentum along motions that are left out.
    unbounded : ndarray of bool, (...)
        Where forces work on a motion that is left out.
    values : ndarray, (..., size)
        Eigenvalues of the scaled matrix, without unit; 0 where they are round-off.
    """
    inertia = np.multiply.outer(frequencies**2, mass)
    sizes = np.abs(stiffness).sum(axis=1) + inertia
    root = 1 / np.sqrt(np.where(sizes > 0, sizes, 1.0))
    dynamic = stiffness - inertia[..., None] * np.eye(len(stiffness))
    values, vectors = np.linalg.eigh(root[..., None] * dynamic * root[..., None, :])
    modes, soft = root[..., None] * vectors, np.abs(values) <= ZERO * len(stiffness)
    across = modes.swapaxes(-1, -2)
    pulled, could = across @ forces, np.abs(across) @ largest
    unbounded = (soft[..., None] & (np.abs(pulled) > WORK * could)).any(axis=(-1, -2))
    motions = modes @ (pulled / np.where(soft, np.inf, values)[..., None])
    weight = np.sqrt(mass)[:, None]
    for at in map(tuple, np.argwhere(soft.any(axis=-1))):
        free = modes[at][:, soft[at]]
        motions[at] -= free @ np.linalg.lstsq(weight * free, weight * motions[at])[0]
    return motions, unbounded, np.where(soft, 0.0, values)
