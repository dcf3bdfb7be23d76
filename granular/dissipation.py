"""Contacts that dissipate: the elastic force plus a part that depends on the rate of the overlap.

The force of a contact is compressive: where a formula gives less than 0 it is 0.  The models have
one bead radius and no rotation: rolling, tangential springs and plastic contacts are left out.
Sources: G. Kuwabara, K. Kono, Jpn. J. Appl. Phys. 26, 1230 (1987), with N. V. Brilliantov and
others, Phys. Rev. E 53, 5382 (1996); K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42, 440 (1975);
Y. Tsuji, T. Tanaka, T. Ishida, Powder Technol. 71, 239 (1992); R. Carretero-Gonzalez and others,
Phys. Rev. Lett. 102, 024102 (2009).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tensegrity import Potential, PowerLaw, TensegrityError, check
from tensegrity.engine.law import Law
from tensegrity.once import once
from tensegrity.printing import concise

RTOL, ATOL = 1e-12, 1e-15  # of a collision in units of its own length, time and speed

UNITS = {"Kuwabara-Kono": "s", "Hunt-Crossley": "s/m", "Tsuji": "kg^(1/2)",
         "Carretero-Gonzalez": "N (s/m)^a", "viscous": "N s/m"}  # fmt: skip


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

    def __post_init__(self) -> None:
        if self.model not in UNITS:
            raise TensegrityError(
                f"model {check.shown(self.model)} of losses is not one of {', '.join(UNITS)}"
            )
        check.number(f"constant of {self.model}", self.constant, least=0)
        power = check.number(f"power of {self.model}", self.power, above=0)
        if power != 1 and self.model != "Carretero-Gonzalez":
            raise TensegrityError(f"power {power:g} of the rate: losses of {self.model} have 1")

    __str__ = concise

    def force(self, d: Any, rate: Any, elastic: Callable[[Any], Any], constant: Any) -> Any:
        """The formula: the force of a contact [N] besides its elastic one.

        Parameters
        ----------
        d, rate : sympy.Expr
            Overlap [m], >= 0, and its rate [m/s].
        elastic : callable sympy.Expr -> sympy.Expr
            The elastic force of an overlap, > 0.
        constant : sympy.Expr
            That of the dissipation.

        Returns
        -------
        sympy.Expr
        """
        import sympy as sp

        x = sp.Symbol("x", positive=True)
        size = rate if self.power == 1 else sp.sign(rate) * abs(rate) ** exact(self.power)
        by_size = {"Kuwabara-Kono": sp.diff(elastic(x), x), "Hunt-Crossley": elastic(x),
                   "Tsuji": sp.sqrt(elastic(x) / x)}  # fmt: skip
        factor = by_size.get(self.model, sp.Integer(1))  # of the first, c times its rate of change
        force = constant * size * factor.subs(x, d)
        return force if factor.subs(x, 0) == 0 else sp.Piecewise((force, d > 0), (0, True))

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
        unit = {"Kuwabara-Kono": length / speed, "Hunt-Crossley": 1 / speed, "Tsuji": mass**0.5}
        return self.constant / unit.get(self.model, force / speed**self.power)


def exact(number: float) -> Any:
    """A number as a ratio where it is a simple one, so that powers become roots."""
    import sympy as sp

    ratio = sp.nsimplify(number, rational=True)
    return ratio if ratio.q <= 8 else sp.Float(number)


def form_of(potential: Potential) -> Any:
    """What of a contact's potential shapes its force: the exponent of a power law, or the law."""
    if isinstance(potential, PowerLaw):
        return potential.exponent
    law = potential.law
    if not getattr(law, "is_expression", False) or law.through:
        raise TensegrityError(f"{potential!r} is no expression of which losses could be made")
    given = len(potential.parameters)
    return Law(potential.expression, law.elongation, tuple(law.parameters[:given]))


def elastic_of(form: Any) -> tuple[Callable[[Any], Any], list[Any]]:
    """The elastic force as a function of the overlap, > 0, and the symbols of its parameters.

    Parameters
    ----------
    form : float or Law
        As of `form_of`.

    Returns
    -------
    callable sympy.Expr -> sympy.Expr, list of sympy.Symbol
    """
    import sympy as sp

    if not isinstance(form, Law):
        stiffness, n = sp.Symbol("stiffness"), exact(form)
        return lambda d: stiffness * d**n, [stiffness]
    x, r, symbols = sp.Symbol("overlap_", positive=True), form.elongation, list(form.parameters)
    names = [sp.Symbol(f"{s}_elastic") for s in symbols]  # of parameters, which differ by name
    closed = form.energy.xreplace({r: -x, **dict(zip(symbols, names, strict=True))})
    steps = (sp.Heaviside, lambda y, *_: sp.Piecewise((1, y > 0), (0, True)))
    force = sp.powsimp(sp.diff(closed.replace(*steps), x))  # without quotients by the overlap
    return lambda d: force.subs(x, d), names


def compressive(model: Dissipation, d: Any, rate: Any, elastic: Any, constant: Any) -> Any:
    """What a model adds to the elastic force, so that the whole is not below 0.

    Parameters
    ----------
    model : Dissipation
    d, rate, elastic, constant
        As of `Dissipation.force`.

    Returns
    -------
    sympy.Expr
    """
    import sympy as sp

    return sp.Max(elastic(d) + model.force(d, rate, elastic, constant), 0) - elastic(d)


ELASTIC = Dissipation("viscous", 0.0)


@once
def collision(
    model: str, power: float, form: Any, values: tuple[float, ...], constant: float,
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> tuple[float, float]:  # fmt: skip
    """Restitution and duration of a collision whose mass and speed are 1.

    Parameters
    ----------
    model : str
    power, constant : float
        As of `Dissipation`; the constant is `scaled`.
    form, values : float or Law, tuple of float
        As of `form_of`, and its parameters; none of a power law, whose stiffness is 1.
    scale : tuple of three float, optional
        Overlap [m], rate [m/s] and force [N] that count as 1.

    Returns
    -------
    restitution, duration : float
        The contact ends when its force is 0 for the last time.

    Raises
    ------
    TensegrityError
        The contact does not end.
    """
    import sympy as sp
    from scipy.integrate import solve_ivp

    d, rate, c = sp.symbols("d rate c")
    elastic, symbols = elastic_of(form)
    general = isinstance(form, Law)
    known: dict[Any, Any] = dict(zip(symbols, values if general else (1,), strict=True))
    formula = elastic(d) + Dissipation(model, constant, power).force(d, rate, elastic, c)
    unlimited = sp.lambdify((d, rate, c), formula.subs(known), "math")
    (length, speed, force), may_pull = scale, general and not constant

    def total(y: Any) -> float:
        return float(unlimited(length * max(y[0], 0.0), speed * y[1], constant)) / force

    def rates(t: float, y: Any) -> tuple[float, float]:
        return y[1], -(total(y) if may_pull else max(total(y), 0.0))

    def released(t: float, y: Any) -> float:
        return total(y) if y[1] < 0 and not may_pull else 1.0

    def separated(t: float, y: Any) -> float:
        return y[0] if y[1] < 0 else 1.0

    released.terminal = not general  # type: ignore[attr-defined]  # a table may press again
    separated.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        rates, (0.0, 1e9), (0.0, 1.0), "DOP853", events=(released, separated), rtol=RTOL, atol=ATOL
    )
    if run.status != 1:
        raise TensegrityError(
            f"a collision with losses of {model} never ends: the partners come to rest in contact, "
            f"at an overlap of {length * float(run.y[0, -1]):.3g} m"
        )
    (*_, end) = (*run.t_events[1], *run.t_events[0]) if not may_pull else run.t_events[1]
    return -float(run.y[1, -1]) if constant else 1.0, float(end)
