"""Potentials of one bond: of a user's energy, of power laws, polynomials that stand for others.

Here live what a spring is, and many springs evaluated at once.  Prisms, which make springs, have
a room of their own.
"""
