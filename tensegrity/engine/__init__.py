"""From a law to machine code that moves a scene: text, compiler, methods, loops.

Here live the laws' forms in CasADi and C, the methods as rows of coefficients, the bonds as the
loop takes them, and every text of a step, once in C and once for the fallback.  It knows no
springs, prisms or scenes: it is handed laws, numbers and rows.
"""
