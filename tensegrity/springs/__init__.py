"""Potentials of a bond: from an energy, power laws, and polynomial approximations.

The package defines a spring and evaluates the springs of all bonds together.  The prisms from which
springs are derived are in `tensegrity.prisms`.
"""
