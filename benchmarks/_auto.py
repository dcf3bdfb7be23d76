"""AUTO-07p, given a prism's equations and their Jacobian as Fortran written from its energy."""

from __future__ import annotations

import os
import re
import subprocess
import time
from pathlib import Path

import numpy as np

AUTO = Path("/usr/lib/auto-07p")

SOURCE = """
      SUBROUTINE FUNC(NDIM,U,ICP,PAR,IJAC,F,DFDU,DFDP)
      IMPLICIT NONE
      INTEGER, INTENT(IN) :: NDIM, ICP(*), IJAC
      DOUBLE PRECISION, INTENT(IN) :: U(NDIM), PAR(*)
      DOUBLE PRECISION, INTENT(OUT) :: F(NDIM)
      DOUBLE PRECISION, INTENT(INOUT) :: DFDU(NDIM,NDIM), DFDP(NDIM,*)
      DOUBLE PRECISION {locals}
{residual}
      IF (IJAC.EQ.0) RETURN
{jacobian}
      IF (IJAC.EQ.1) RETURN
      DFDP(1,1) = 0
      DFDP(2,1) = 0
      DFDP(3,1) = 1
      END SUBROUTINE FUNC

      SUBROUTINE STPNT(NDIM,U,PAR,T)
      IMPLICIT NONE
      INTEGER, INTENT(IN) :: NDIM
      DOUBLE PRECISION, INTENT(INOUT) :: U(NDIM), PAR(*)
      DOUBLE PRECISION, INTENT(IN) :: T
      PAR(1) = 0
      PAR(2) = {height!r}D0
      U(1) = {base!r}D0
      U(2) = {twist!r}D0
      U(3) = {height!r}D0
      END SUBROUTINE STPNT

      SUBROUTINE PVLS(NDIM,U,PAR)
      IMPLICIT NONE
      INTEGER, INTENT(IN) :: NDIM
      DOUBLE PRECISION, INTENT(IN) :: U(NDIM)
      DOUBLE PRECISION, INTENT(INOUT) :: PAR(*)
      PAR(2) = U(3)
      END SUBROUTINE PVLS

      SUBROUTINE BCND
      END SUBROUTINE BCND
      SUBROUTINE ICND
      END SUBROUTINE ICND
      SUBROUTINE FOPT
      END SUBROUTINE FOPT
"""

CONSTANTS = """NDIM = 3
IPS = 1
IRS = 0
ILP = 1
ICP = [1, 2]
NTST = 1
NCOL = 4
IAD = 3
ISP = 0
ISW = 1
IPLT = 0
NBC = 0
NINT = 0
NMX = 5000
NPR = 5000
MXBF = 0
IID = 0
ITMX = 8
ITNW = 7
NWTN = 3
JAC = 1
EPSL = 1e-10
EPSU = 1e-10
EPSS = 1e-8
DS = {first}
DSMIN = 1e-7
DSMAX = {largest}
IADS = 1
NPAR = 2
THL = {{1: 1.0}}
THU = {{}}
RL0 = -10
RL1 = 10
A0 = 0
A1 = 100
UZSTOP = {{2: {lowest}}}
"""


def build(folder, start, unknowns, gradient, jacobian):
    """Compile AUTO with these equations, to begin at (l, phi, h, load); the program's path."""
    import sympy as sp

    shared, forms = sp.cse([*gradient, *jacobian[:, :3]])
    names = {symbol: sp.Symbol(f"U({i + 1})") for i, symbol in enumerate(unknowns[:3])}
    names[unknowns[3]] = sp.Symbol("PAR(1)")

    def line(target, expression):
        expression = expression.subs(names).subs(sp.pi, sp.Float(np.pi, 17))
        text = sp.fcode(expression, source_format="free", standard=95, precision=17)
        return f"      {target} = {text}"

    def needed(expressions):
        """The shared terms that some expressions use, in order."""
        wanted, found = set().union(*(e.free_symbols for e in expressions)), []
        for symbol, term in reversed(shared):
            if symbol in wanted:
                wanted |= term.free_symbols
                found.append((symbol, term))
        return found[::-1]

    first = needed(forms[:3])
    later = [pair for pair in needed(forms[3:]) if pair not in first]
    residual = [line(s, t) for s, t in first]
    residual += [line(f"F({i + 1})", form) for i, form in enumerate(forms[:3])]
    rest = [line(s, t) for s, t in later]
    rest += [line(f"DFDU({i // 3 + 1},{i % 3 + 1})", form) for i, form in enumerate(forms[3:])]
    base, twist, height = map(float, start[:3])
    text = SOURCE.format(
        locals=", ".join(str(s) for s, _ in shared), residual="\n".join(residual),
        jacobian="\n".join(rest), base=base, twist=twist, height=height,
    )  # fmt: skip
    (folder / "prism.f90").write_text(text)
    objects = sorted(str(x) for x in (AUTO / "lib").glob("*.o"))
    flags = ["-O3", "-march=native", "-fopenmp", "-w", "-ffree-line-length-none"]
    command = ["gfortran", *flags, "prism.f90", *objects, "-o", "prism"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return folder / "prism"


def run(program, largest, lowest):
    """Rows, and seconds: as a process, and inside the program as it prints them."""
    folder = program.parent
    constants = CONSTANTS.format(first=min(0.01, largest), largest=largest, lowest=lowest)
    (folder / "fort.2").write_text(constants)
    environment = os.environ | {"AUTO_DIR": str(AUTO), "OMP_NUM_THREADS": "1"}
    started = time.perf_counter()
    answer = subprocess.run(
        [str(program)], cwd=folder, check=True, capture_output=True, text=True, env=environment
    )
    whole = time.perf_counter() - started
    inside = float(re.search(r"Total Time\s+([\d.E+-]+)", answer.stdout).group(1))
    rows = [x.split() for x in (folder / "fort.7").read_text().splitlines()]
    rows = np.array([[float(x) for x in row] for row in rows if row and row[0] != "0"])
    return (rows[:, 8], rows[:, 4]), inside, whole
