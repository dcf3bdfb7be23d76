"""Arc-length continuation of any problem of a few unknowns: branches, located events, tables.

It knows no prism: problems are CasADi expressions.
"""
