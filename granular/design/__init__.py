"""Design of protectors: chains of beads between a striker and a wall with the least peak force.

`peak_force` evaluates designs, `Order`, `Sizes` and `Choice` define the spaces of designs, and
`search` finds the best design of a space.  `robustness` computes the effect of deviations of
diameters, gaps and speed on a design, and with a `Scatter` `search` minimises this effect.
Source: the talk, part II, "Optimal Design of Granular Protectors".
"""

from granular.design.finalists import robustness
from granular.design.objective import peak_force
from granular.design.scatter import Scatter
from granular.design.searching import search
from granular.design.spaces import Choice, Order, Sizes

__all__ = [
    "Choice",
    "Order",
    "Scatter",
    "Sizes",
    "peak_force",
    "robustness",
    "search",
]
