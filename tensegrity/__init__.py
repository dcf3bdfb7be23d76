"""Tensegrity prisms as springs, lattices of masses joined by springs, and their nonlinear waves.

"The talk" in docstrings is *Wave Dynamics of Innovative Nonlinear Lattices*, "the paper" *Highly
nonlinear pulse splitting and recombination in a two-dimensional granular network* (2010).

The packages `granular` and `derivations`, whose names others use too, are also
`tensegrity.granular` and `tensegrity.derivations`: the same modules.
"""

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = "0.1.0"  # pyproject.toml reads it here


class _Sibling:
    """Finds modules of the packages beside this one under its name, before a search of their
    folders would load them a second time."""

    @classmethod
    def find_spec(cls, name, path=None, target=None):  # type: ignore[no-untyped-def]
        if name.startswith(("tensegrity.granular", "tensegrity.derivations")):
            return ModuleSpec(name, cls())
        return None

    def create_module(self, spec):  # type: ignore[no-untyped-def]
        module = import_module(spec.name.removeprefix("tensegrity."))
        self.own = module.__spec__
        return module

    def exec_module(self, module):  # type: ignore[no-untyped-def]
        module.__spec__ = self.own


sys.meta_path.insert(0, _Sibling)  # type: ignore[arg-type]
