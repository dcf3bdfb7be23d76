"""From a force law to machine code that advances a scene: C text, compiler, methods, loops.

The package holds the laws in CasADi and C, the methods as rows of coefficients, the layout of
bonds for the loops, and the C text of all steps.  It knows no springs, prisms or scenes; its
arguments are laws, numbers and arrays.
"""
