"""The compiled loop that advances a scene.

What runs where:

| | chain | network in 1, 2, 3 dimensions |
|---|---|---|
| parameters common, own to each bond | yes | yes |
| lanes of one scene, or of several | side by side in one loop | in turn |
| threads | pieces of long chains | pieces of large ones, by splittings |
| walls, loads | no: a network on a line has them | yes |
| "corrected6" | yes, lanes too, on one thread | yes |
| implicit steps | yes, lanes in turn | yes; one thread |
| fitted forces | yes | yes |
| prescribed motions, forces in time | yes, one lane, one thread | yes, one thread |
| dashpots | in bonds and to the ground | to the ground |
| springs that change in time | yes, all alike, one lane, one thread | no |

Bonds that join neighbours in order, without walls and loads, are a chain whatever the scene
calls them: one pass over them does a stage.  A processor works on several short chains in the
time of one where their sites stand side by side; contacts of a network fill it already.
"""

from __future__ import annotations

from tensegrity.engine import threaded
from tensegrity.engine.bound import Bound
from tensegrity.engine.compiled import compiled
from tensegrity.engine.methods import Splitting


def bind(u, v, bonds, method, dt, loop=None, divided=True):
    """Prepare a scene whose rows `u` and `v` are advanced in place.

    Parameters
    ----------
    u, v : ndarray, C-contiguous
        (sites,), (sites, lanes), or (rows, dim): sites, walls, and a spare row.
    bonds : Bonds
    method : Method
    dt : float
        [s]
    loop : Compiled, optional
        By default that of the bonds.
    divided : bool, optional
        Whether a long chain or a large network may be advanced on several threads.

    Raises
    ------
    CompilerError
    """
    lanes = 1 if bonds.dim or u.ndim == 1 else u.shape[1]
    if loop is None:
        loop = compiled(bonds.laws, bonds.own, bonds.dim, lanes)
    large = len(bonds.group) > threaded.MANY if bonds.dim else u.size > threaded.LONG and lanes == 1
    count = threaded.threads() if divided and large and isinstance(method, Splitting) else 1
    if count > 1:
        kind = threaded.ThreadedNetwork if bonds.dim else threaded.ThreadedChain
        return kind(loop, u, v, bonds, method, dt, count)
    return Bound(loop, u, v, bonds, method, dt)
