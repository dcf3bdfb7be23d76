"""Arc-length continuation of solution branches, with located events, as tables.

A problem is a set of CasADi expressions, or arrays for many unknowns; nothing here is specific to
prisms or structures.
"""
