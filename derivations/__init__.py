"""Symbolic derivations: energies and geometric relations, typed once, and what follows."""
