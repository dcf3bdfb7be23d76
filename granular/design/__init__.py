"""Design of protectors: beads between a striker and a wall, such that the wall feels least.

`peak_force` says what a design is worth, `Order`, `Sizes` and `Choice` what may be changed, and
`search` looks for the best.  Source: seeds/000, part II, "Optimal Design of Granular Protectors".
"""

from granular.design.objective import peak_force
from granular.design.searching import search
from granular.design.spaces import Choice, Order, Sizes

__all__ = ["Choice", "Order", "Sizes", "peak_force", "search"]
