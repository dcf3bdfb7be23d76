"""Units of a user's own: coordinates, members and energies in SymPy, and what follows from them.

Self-stress, equilibria, paths with events, stiffness and formulas of any unit that one coordinate
compresses.  The prisms are in `tensegrity.prisms`.
"""
