"""Structures of any bars and strings: self-stress, stiffness, equilibria with slack strings, paths.

Members are straight and elastic, joined at nodes without friction; strings pull only, bars pull
and push and do not bend; no member has thickness.
"""
