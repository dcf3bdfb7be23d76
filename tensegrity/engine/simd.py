"""CasADi functions as C for several elongations in SIMD registers (`pack`); see `simd.c`.

CasADi writes scalar C, which compilers vectorise only in part, with the processor's own square
roots.  Here the same instructions are written for vectors of numbers: one reciprocal for all
divisions by the same value, and none where the inverse of its root is computed.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

TINY = 1e-300  # least argument of a root that needs no treatment of 0
QUARTERS = 32  # powers with exponents up to 8 in quarters become products and roots


def _names(ca):
    """C of operations, {operation: text with arguments a and b}, and names in the C library."""
    texts = {
        ca.OP_ASSIGN: "{a}", ca.OP_ADD: "{a} + {b}", ca.OP_SUB: "{a} - {b}",
        ca.OP_MUL: "{a} * {b}", ca.OP_NEG: "-{a}", ca.OP_SQ: "{a} * {a}", ca.OP_TWICE: "2 * {a}",
        ca.OP_LT: "TRUTH({a} < {b})", ca.OP_LE: "TRUTH({a} <= {b})",
        ca.OP_EQ: "TRUTH({a} == {b})", ca.OP_NE: "TRUTH({a} != {b})",
        ca.OP_NOT: "TRUTH({a} == wide(0))", ca.OP_AND: "{a} * {b}", ca.OP_OR: "larger_of({a}, {b})",
        ca.OP_FMAX: "larger_of({a}, {b})", ca.OP_FMIN: "smaller_of({a}, {b})",
        ca.OP_FABS: "magnitude({a})", ca.OP_SIGN: "TRUTH({a} > wide(0)) - TRUTH({a} < wide(0))",
        ca.OP_IF_ELSE_ZERO: "only((mask)({a} != wide(0)), {b})",
    }  # fmt: skip
    library = [
        "EXP", "LOG", "TAN", "ASIN", "ACOS", "ATAN", "SINH", "COSH", "TANH", "ASINH",
        "ACOSH", "ATANH", "FLOOR", "CEIL", "ERF", "ATAN2", "FMOD", "COPYSIGN",
    ]  # fmt: skip
    called = {getattr(ca, f"OP_{name}"): name.lower() for name in library}
    return texts, called | {ca.OP_POW: "library_power", ca.OP_CONSTPOW: "library_power"}


def text(function, name, arguments, inputs, outputs):
    """C of a function for the vectors number 0 to n - 1, in several passes.

    Each pass ends at a root or a division: the speed of a processor is limited by the longest chain
    of slow operations within its instruction window, not by their number alone.

    Parameters
    ----------
    function : casadi.Function
        Made of SX.
    name, arguments : str
        Name and further arguments of the C function, whose first argument is n.
    inputs, outputs : sequence of sequences of str
        C of vector number g of each entry of each argument, and of each result.

    Returns
    -------
    str
    """
    import casadi as ca

    stored, passes = _Body(ca, inputs, outputs).of(function)
    room = f"    pack stored[{stored}][ROOM];\n" * (stored > 0)
    return _noinline(name, arguments, room + _loops(passes))


def two_functions(function, name, given, arguments, inputs, outputs):
    """C of a function in two parts, for arguments that are not stored in arrays.

    `first_<name>` does the first pass for vector number g of the `given` arguments, `rest_<name>`
    the others for the vectors number 0 to n - 1, without these arguments.  Intermediate values are
    in the last argument, `stored`.  If no arguments are given and there is only one pass, it is in
    the second function, as the first one writes no results.

    Parameters
    ----------
    function, name, arguments, inputs, outputs
        As of `text`.
    given : str
        Arguments of the first function only.

    Returns
    -------
    int, str
        Number of intermediate vectors for each g, and the C of both functions.
    """
    import casadi as ca

    stored, passes = _Body(ca, inputs, outputs, copied=bool(given)).of(function, short=not given)
    first, *rest = passes if given or len(passes) > 1 else ("", *passes)
    arguments += ", pack (*restrict stored)[ROOM]"
    begin = f"PACKED void first_{name}(integer g, {given}{arguments})\n{{\n{first}}}\n"
    return stored, begin + _noinline(f"rest_{name}", arguments, _loops(rest))


def _noinline(name, arguments, body):
    return f"__attribute__((noinline)) static void {name}(integer n, {arguments})\n{{\n{body}}}\n"


def _loops(passes):
    return "".join(f"    for (integer g = 0; g < n; g++) {{\n{x}    }}\n" for x in passes)


def benefits_from_simd(function):
    """Whether a function has roots, quotients or sines, and no operation that SIMD code lacks."""
    import casadi as ca

    names = [[f"x[{k}]" for k in range(function.numel_in(j))] for j in range(function.n_in())]
    body = "".join(_Body(ca, names, [["y"]]).of(function)[1])
    slow = any(x in body for x in ("root", "quotient(", "sine_cosine("))
    return slow and "ONE_BY_ONE" not in body


@dataclass
class _Value:
    """A constant of the text: its pass, and whether it is available in the next pass only."""

    level: int
    slow: bool = False


class _Body:
    """The statements of one function, with each value in a separate constant."""

    def __init__(self, ca, inputs, outputs, copied=False):
        self._ca, self._inputs, self._outputs = ca, inputs, outputs
        self._copied = copied  # arguments that later passes do not have
        self._texts, self._library = _names(ca)
        self._lines = []  # (pass, names set, names read, text)
        self._values = {}  # name -> _Value
        self._known = {}  # expression -> name: CasADi repeats divisions
        self._divisors = set()  # names of repeated divisors
        self._negated = {}  # name -> name of the value that it is the negative of
        self._less = {}  # name of a comparison -> its C function and arguments
        self._positive = set()  # names of values with a positive lower bound

    def of(self, function, short=False):
        ca, work = self._ca, {}
        below = self._denominators(function)
        for k in range(function.n_instructions()):
            operation = function.instruction_id(k)
            source, target = function.instruction_input(k), function.instruction_output(k)
            if operation == ca.OP_CONST:
                work[target[0]] = _literal(function.instruction_constant(k))
            elif operation == ca.OP_INPUT:
                given = self._inputs[source[0]][source[1]]
                work[target[0]] = self._new(given) if self._copied else given
            elif operation == ca.OP_OUTPUT:
                given = work[source[0]]
                self._add(f"{self._outputs[target[0]][target[1]]} = {given};", (), (given,))
            else:
                a, b = (*(work[s] for s in source), None)[:2]
                work[target[0]] = self._value(operation, a, b, below.get(k, 0))
                if below.get(k, 0) > 1:
                    self._divisors.add(work[target[0]])
        return self._passes(short)

    def _denominators(self, function):
        """How often the result of each instruction is a divisor."""
        made, uses = {}, {}
        for k in range(function.n_instructions()):
            operation, source = function.instruction_id(k), function.instruction_input(k)
            if operation in (self._ca.OP_DIV, self._ca.OP_INV):
                uses[made[source[-1]]] = uses.get(made[source[-1]], 0) + 1
            if operation != self._ca.OP_OUTPUT:
                made[function.instruction_output(k)[0]] = k
        return uses

    def _value(self, operation, a, b, divides):
        ca = self._ca
        if operation == ca.OP_SQRT:
            return self._roots(a) if divides else self._root(a)
        if operation in (ca.OP_POW, ca.OP_CONSTPOW) and (n := _quarters(b)) is not None:
            return self._power(a, n)
        if operation == ca.OP_INV:
            return self._new(_inverse(a), a, slow=True)
        if operation == ca.OP_DIV:
            if _inverse(b) in self._known or b in self._divisors:
                inverse = self._new(_inverse(b), b, slow=True)
                return self._new(f"{a} * {inverse}", a, inverse)
            return self._new(f"quotient({a}, {b})", a, b, slow=True)
        if operation in (ca.OP_LT, ca.OP_LE):
            return self._comparison(operation, a, b)
        if operation == ca.OP_MUL and b in self._less:
            a, b = b, a
        if operation in (ca.OP_MUL, ca.OP_IF_ELSE_ZERO) and a in self._less:
            call, *compared = self._less[a]
            return self._new(f"{call}({', '.join(compared)}, {b})", *compared, b)
        if operation in (ca.OP_SIN, ca.OP_COS):
            return self._turn(a)[operation == ca.OP_COS]
        if operation in self._texts:
            return self._plain(operation, a, b)
        if operation in self._library:
            return self._one_by_one(self._library[operation], a, b)
        raise NotImplementedError(f"operation {operation} of CasADi")

    def _plain(self, operation, a, b):
        ca = self._ca
        name = self._new(self._texts[operation].format(a=a, b=b), a, b)
        if operation == ca.OP_NEG:
            self._negated[name] = a
        if operation == ca.OP_FMAX and any(_number(x) > TINY for x in (a, b)):
            self._positive.add(name)
        return name

    def _comparison(self, operation, a, b):
        if _number(a) == 0 and b in self._negated:
            a, b = self._negated[b], a
        name = self._new(self._texts[operation].format(a=a, b=b), a, b)
        self._less[name] = "if_less" if operation == self._ca.OP_LT else "if_at_most", a, b
        return name

    def _root(self, a):
        kind = "root_of_positive" if a in self._positive else "root"
        return self._new(f"{kind}({a})", a, slow=True)

    def _add(self, line, sets, reads):
        reads = [self._values[x] for x in reads if x in self._values]
        level = max((x.level + (x.slow and bool(sets)) for x in reads), default=0)
        self._lines.append((level, sets, line))
        return level

    def _name(self, expression, line, *reads, slow=False):
        """A new value with the line that computes it, in which it is {0}."""
        name = f"x{len(self._values)}"
        level = self._add(line.format(name), (name,), reads)
        self._known[expression], self._values[name] = name, _Value(level, slow)
        return name

    def _new(self, expression, *reads, slow=False):
        if expression in self._known:
            return self._known[expression]
        return self._name(expression, f"{{0}} = {expression};", *reads, slow=slow)

    def _roots(self, a):
        """A root and its inverse, which costs less than the root itself."""
        if f"root({a})" not in self._known:
            down = self._name(f"inverse of root({a})", f"{{0}} = inverse_root({a});", a, slow=True)
            up = self._new(f"root_by({a}, {down})", a, down)
            self._known[f"root({a})"], self._known[_inverse(up)] = up, down
        return self._known[f"root({a})"]

    def _power(self, a, quarters):
        whole, rest = divmod(quarters, 4)
        half = self._root(a) if rest else None
        factors = [half] if rest >= 2 else []
        factors += [self._new(f"root({half})", half, slow=True)] if rest % 2 else []
        factors += [a] * whole or ["wide(1)"]
        return self._new(" * ".join(factors), *factors)

    def _turn(self, a):
        """The sine and the cosine of a value."""
        if (call := f"sine_cosine({a})") not in self._known:
            count = len(self._values)
            both = f"x{count}", f"x{count + 1}"
            level = self._add(f"sine_cosine({a}, &{both[0]}, &{both[1]});", both, (a,))
            self._known[call] = both
            self._values |= {name: _Value(level) for name in both}
        return self._known[call]

    def _one_by_one(self, called, a, b):
        given = [_scalar(x) for x in (a, b) if x is not None]
        call = f"ONE_BY_ONE({{0}}, {called}, {', '.join(given)})"
        return self._known.get(call) or self._name(call, call, a, b, slow=True)

    def _levels(self, short):
        """The number of the last pass, and the lines with theirs; if `short`, a last pass without
        slow operations is merged with the one before.  A single slow operation needs one pass."""
        slow = [value.level for value in self._values.values() if value.slow]
        ends = slow if short else [line[0] for line in self._lines]
        last = max(ends, default=0) if len(slow) > 1 else 0
        return last, [(min(level, last), *line) for level, *line in self._lines]

    def _passes(self, short):
        """The number of values that later passes need, stored in arrays, and the C of each pass."""
        last, lines = self._levels(short)
        level_of = {name: level for level, sets, _ in lines for name in sets}
        levels, later = [[] for _ in range(1 + last)], [set() for _ in range(1 + last)]
        for level, _, line in lines:
            names = level_of.keys() & re.findall(r"\bx\d+\b", line)
            later[level] |= {name for name in names if level_of[name] < level}
        needed, stored = set().union(*later), {}
        for level, sets, line in lines:
            levels[level].append(f"pack {', '.join(sets)}; {line}" if sets else line)
            for name in sets:
                if name in needed:
                    stored[name] = f"stored[{len(stored)}][g]"
                    levels[level].append(f"{stored[name]} = {name};")
        passes = []
        for lines, names in zip(levels, later, strict=True):
            loads = [f"const pack {name} = {stored[name]};" for name in sorted(names)]
            passes.append("".join(f"        {line}\n" for line in loads + lines))
        return len(stored), passes


def _inverse(value):
    return f"quotient(wide(1), {value})"


def _literal(value):
    if math.isnan(value):
        return "wide(NAN)"
    if math.isinf(value):
        return "wide(-INFINITY)" if value < 0 else "wide(INFINITY)"
    return f"wide({value!r})"


def _number(value):
    """A literal's number; NaN of anything else."""
    try:
        return float(value.removeprefix("wide(").removesuffix(")"))
    except ValueError:
        return math.nan


def _scalar(value):
    return value[5:-1] if value.startswith("wide(") else f"LANE({value}, l)"


def _quarters(b):
    """Four times a constant exponent, where that is a small whole number."""
    n = 4 * _number(b)
    return int(n) if 0 <= n <= QUARTERS and n.is_integer() else None
