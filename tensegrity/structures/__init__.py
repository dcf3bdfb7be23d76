"""Structures of bars and strings: self-stress, stiffness, equilibria with slack strings, paths.

Members are straight and elastic and joined by frictionless hinges; strings carry tension only,
bars tension and compression without bending; no member has thickness.
"""
