"""Tensegrity prisms as springs, lattices of masses joined by springs, and their nonlinear waves.

"The talk" in docstrings is *Wave Dynamics of Innovative Nonlinear Lattices*, "the paper" *Highly
nonlinear pulse splitting and recombination in a two-dimensional granular network* (2010).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = "0.1.0"  # pyproject.toml reads it here
