"""The tensegrity prism: potential, equilibrium paths, limit load, stability, fits to measurements.

The formulas are derived in `derivations`; this package evaluates them.
"""
