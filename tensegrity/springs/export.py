"""Springs for other programs: `to_c` writes a potential as a self-contained C file.

The text is what CasADi generates from the law, as for the compiled loops of this package, with the
parameters of one spring.  It is C99 and needs only the mathematical functions of the C library.
"""

from __future__ import annotations

import math
import re
from os import PathLike
from pathlib import Path
from typing import Any

from tensegrity import check
from tensegrity.engine.law import functions

QUANTITIES = {"energy": "V(r) [J]", "tension": "dV/dr [N], > 0 in extension",
              "stiffness": "d2V/dr2 [N/m]"}  # fmt: skip

QUIET = """#define CASADI_SYMBOL_EXPORT static
#ifdef __GNUC__ /* CasADi writes functions besides that nobody calls */
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
"""
DRIVER = """
#ifdef DRIVER
/* Prints a table: at the elongations given as arguments, or at nine within the domain. */
#include <stdio.h>
#include <stdlib.h>

int main(int count, char **given)
{{
    double low = {name}_lowest > -1 ? {name}_lowest : -1;
    double high = {name}_highest < 1 ? {name}_highest : 1;
    int rows = count > 1 ? count - 1 : 9;
    printf("elongation,energy,tension,stiffness\\n");
    for (int i = 0; i < rows; i++) {{
        double r = count > 1 ? atof(given[i + 1]) : low + (high - low) * (i + 1) / (rows + 1);
        if (!(r > {name}_lowest && r < {name}_highest)) {{
            fprintf(stderr, "%g is outside of the domain\\n", r);
            return 1;
        }}
        printf("%.17g,%.17g,%.17g,%.17g\\n", r, {name}_energy(r), {name}_tension(r),
               {name}_stiffness(r));
    }}
    return 0;
}}
#endif
"""


def to_c(potential: Any, path: str | PathLike[str]) -> Path:
    """See `tensegrity.Potential.to_c`."""
    path = check.path("path", path)
    text = _text(potential, _identifier(path.stem))
    with check.replacing(path) as new:
        new.write_text(text, encoding="utf-8")
    return path


def _text(potential: Any, name: str) -> str:
    """The C text that `to_c` writes, with names that begin with `name`."""
    import casadi as ca

    law, (low, high) = potential.law, potential.computable_domain
    generator = ca.CodeGenerator(f"{name}_of.c")
    for quantity in QUANTITIES:
        symbols = functions(law)[quantity].sx_in()
        form = functions(law)[quantity](*symbols)
        generator.add(ca.Function(f"{name}_{quantity}_of", symbols, [form]))
    rows = zip(potential.values.tolist(), map(str, law.parameters), strict=True)
    listed = "".join(f"    {_number(value)}, /* {_comment(key)} */\n" for value, key in rows)
    parts = [
        f"/* {_comment(repr(potential))}\n\n"
        "   r is the elongation from the equilibrium [m], extension > 0; see the functions at the\n"
        f"   end.  With -DDRIVER a program that prints a table: cc -DDRIVER {name}.c -lm */\n",
        QUIET,
        generator.dump(),
        "#ifdef __GNUC__\n#pragma GCC diagnostic pop\n#endif\n",
        f"static const double {name}_parameters[] = {{\n{listed or '    0.0'}}};\n",
        f"const double {name}_lowest = {_number(low)};   /* [m]: between these it is defined */",
        f"const double {name}_highest = {_number(high)}; /* [m] */\n",
    ]
    for quantity, meaning in QUANTITIES.items():
        parts.append(
            f"/* {meaning} */\n"
            f"double {name}_{quantity}(double r)\n{{\n"
            "    double result;\n"
            f"    const double *given[2] = {{&r, {name}_parameters}};\n"
            "    double *found[1] = {&result};\n"
            f"    {name}_{quantity}_of(given, found, 0, 0, 0);\n"
            "    return result;\n}\n"
        )
    return "\n".join(parts) + DRIVER.format(name=name)


def _identifier(stem: str) -> str:
    """The stem of a file's name as a prefix of names in C."""
    words = re.sub(r"[^0-9A-Za-z]+", "_", stem).strip("_")  # CasADi refuses two _ in a row
    return words if words[:1].isalpha() else f"spring_{words}".rstrip("_")


def _number(value: float) -> str:
    if math.isinf(value):
        return "HUGE_VAL" if value > 0 else "-HUGE_VAL"
    return repr(float(value))


def _comment(text: str) -> str:
    """Text without the marks that end or begin a comment in C."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
