"""Contacts that dissipate: the elastic force plus a part that depends on the rate of the overlap.

The force of a contact is compressive: where a formula gives less than 0 it is 0.  The models have
one bead radius and no rotation: rolling, tangential springs and plastic contacts are left out.
Sources: G. Kuwabara, K. Kono, Jpn. J. Appl. Phys. 26, 1230 (1987), with N. V. Brilliantov and
others, Phys. Rev. E 53, 5382 (1996); K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42, 440 (1975);
R. Carretero-Gonzalez and others, Phys. Rev. Lett. 102, 024102 (2009).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tensegrity.once import once
from tensegrity.printing import concise

RTOL, ATOL = 1e-12, 1e-15  # of a collision in units of its own length, time and speed

UNITS = {"Kuwabara-Kono": "s", "Hunt-Crossley": "s/m", "Carretero-Gonzalez": "N (s/m)^a",
         "viscous": "N s/m"}  # fmt: skip


@dataclass(frozen=True)
class Dissipation:
    """The part of a contact force that depends on the rate of the overlap.

    Attributes
    ----------
    model : str
        A key of `UNITS`.
    constant : float
        In the unit of the model, >= 0.
    power : float
        Of the rate, > 0; 1 but for Carretero-Gonzalez.
    """

    model: str
    constant: float
    power: float = 1.0

    __str__ = concise

    def force(self, d: Any, rate: Any, stiffness: Any, exponent: Any, constant: Any) -> Any:
        """The formula: the force of a contact [N] besides its elastic one.

        Parameters
        ----------
        d, rate : sympy.Expr
            Overlap [m], >= 0, and its rate [m/s].
        stiffness, exponent, constant : sympy.Expr
            Those of the elastic force, and that of the dissipation.

        Returns
        -------
        sympy.Expr
        """
        import sympy as sp

        elastic = stiffness * d**exponent
        if self.model == "Kuwabara-Kono":  # c times the rate of the elastic force
            return constant * rate * exponent * stiffness * d ** (exponent - 1)
        if self.model == "Hunt-Crossley":
            return constant * rate * elastic
        size = rate if self.power == 1 else sp.sign(rate) * abs(rate) ** exact(self.power)
        return sp.Piecewise((constant * size, d > 0), (0, True))

    def scaled(self, stiffness: float, exponent: float, mass: float, speed: float) -> float:
        """The constant in units of a collision, in which speed, mass and stiffness are 1.

        Parameters
        ----------
        stiffness, exponent : float
            Of the elastic force [N/m^exponent].
        mass, speed : float
            Reduced mass [kg], speed of approach [m/s].

        Returns
        -------
        float
        """
        length = (mass * speed**2 / stiffness) ** (1 / (exponent + 1))
        force = stiffness * length**exponent
        unit = {"Kuwabara-Kono": length / speed, "Hunt-Crossley": 1 / speed}
        return self.constant / unit.get(self.model, force / speed**self.power)


def exact(number: float) -> Any:
    """A number as a ratio where it is a simple one, so that powers become roots."""
    import sympy as sp

    ratio = sp.nsimplify(number, rational=True)
    return ratio if ratio.q <= 8 else sp.Float(number)


def compressive(model: Dissipation, d: Any, rate: Any, *constants: Any) -> Any:
    """What a model adds to the elastic force, so that the whole is not below 0.

    Parameters
    ----------
    model : Dissipation
    d, rate, *constants : sympy.Expr
        As of `Dissipation.force`.

    Returns
    -------
    sympy.Expr
    """
    import sympy as sp

    elastic = constants[0] * d ** constants[1]
    return sp.Max(elastic + model.force(d, rate, *constants), 0) - elastic


ELASTIC = Dissipation("viscous", 0.0)


@once
def collision(model: str, power: float, exponent: float, constant: float) -> tuple[float, float]:
    """Restitution and duration of a collision whose mass, stiffness and speed are 1.

    Parameters
    ----------
    model : str
    power, constant : float
        As of `Dissipation`; the constant is `scaled`.
    exponent : float
        Of the elastic force.

    Returns
    -------
    restitution, duration : float
        The contact ends when its force is 0 again.
    """
    import sympy as sp
    from scipy.integrate import solve_ivp

    d, rate, c = sp.symbols("d rate c")
    loss, n = Dissipation(model, constant, power), exact(exponent)
    formula = d**n + loss.force(d, rate, sp.Integer(1), n, c)
    whole = sp.lambdify((d, rate, c), sp.Max(formula, 0), "math")
    unlimited = sp.lambdify((d, rate, c), formula, "math")

    def rates(t: float, y: Any) -> tuple[float, float]:
        return y[1], -whole(max(y[0], 0.0), y[1], constant)

    def released(t: float, y: Any) -> float:
        return unlimited(max(y[0], 0.0), y[1], constant) if y[1] < 0 else 1.0

    def separated(t: float, y: Any) -> float:
        return y[0] if y[1] < 0 else 1.0

    for event in (released, separated):
        event.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        rates, (0.0, 1e9), (0.0, 1.0), "DOP853", events=(released, separated), rtol=RTOL, atol=ATOL
    )
    return -float(run.y[1, -1]), float(run.t[-1])
