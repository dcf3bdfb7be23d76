"""Periodic lattices of bars and strings: states under macroscopic strain, bands, moduli, stability.

A cell of nodes and members repeats along one, two or three lattice vectors.  Every linear property
refers to a state: positions, tensions and slack strings of the cell.
"""
