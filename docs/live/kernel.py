"""The C of the page and its WebAssembly: generated laws, the project's loop, `live.c`, `wave.c`."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

import casadi as ca

from derivations import rigid_elastic
from tensegrity import METHODS, Prism
from tensegrity.engine.codegen import c_text, scalar
from tensegrity.engine.law import functions, to_casadi
from tensegrity.prisms.closed import rigid_law, rigid_programs

FOLDER = Path(__file__).parent
METHOD = METHODS["rkn6"]
ELASTIC_PRISM = Prism(1.0, 0.5, 0.4, 1.0, k_base=2.0, k_bar=20.0)
ELASTIC = ELASTIC_PRISM.potential(preload=0.05)  # it softens
EXPORT = "#define EXPORT(name) __attribute__((export_name(#name)))"
FLAGS = ("-O3", "-target", "wasm32-wasi", "-msimd128", "-mexec-model=reactor", "-Wl,--no-entry",
         "-Wl,--strip-all", "-Wl,--gc-sections", "-ffunction-sections", "-fno-math-errno",
         "-Wl,-z,stack-size=65536")  # fmt: skip


def missing() -> str:
    """What is not there to compile with, or nothing."""
    found = importlib.util.find_spec("ziglang")
    return "" if found else "the Python package ziglang is not installed (extra cc)"


def text() -> str:
    """All of the C."""
    elastic = ELASTIC.law
    laws = rigid_law(), elastic
    given = {0: ("energy", "stiffness", "slope"), 1: ("energy", "stiffness")}  # and the tension
    more = [scalar(k, name, functions(laws[k])[name]) for k in given for name in given[k]]
    more.append(scalar(0, "half_turn", _half_turn()))
    loop = c_text(laws, helpers=[*more, *_approximate()])
    programs = rigid_programs()
    own = ", ".join(map(repr, ELASTIC.values.tolist()))
    numbers = {
        "STAGES": METHOD.stages,
        "CLOSING": int(METHOD.kicks[-1] != 0),
        "KICKS": ", ".join(map(repr, METHOD.kicks)),
        "DRIFTS": ", ".join(map(repr, METHOD.drifts)),
        "STEP": repr(METHOD.default_fraction),
        "LIMIT": repr(METHOD.stability_limit),
        "RIGID_PARAMETERS": len(rigid_law().parameters),
        "ELASTIC_PARAMETERS": len(ELASTIC.values),
        "ELASTIC_LENGTH": repr(ELASTIC.length),
        "ELASTIC_LOWEST": repr(ELASTIC.computable_domain[0]),
        "ELASTIC_HIGHEST": repr(ELASTIC.computable_domain[1]),
        **{role.upper(): place for role, place in programs["places"].items()},
    }
    return "\n".join([
        loop,
        EXPORT,
        *(f"#define {name} {value}" for name, value in numbers.items()),
        f"static const real elastic_numbers[] = {{{own}}};",
        program_text("rigid_parameters", programs["parameters"]),
        program_text("locking_height_squared", programs["locking"]),
        *(f'#line 1 "{name}"\n{(FOLDER / name).read_text()}' for name in ("live.c", "wave.c")),
    ])  # fmt: skip


def _half_turn():
    """Tangent of half the change of twist of a rigid prism, of r and its parameters."""
    form, symbols = rigid_elastic.half_turn(), (rigid_elastic.elongation, *rigid_elastic.PARAMETERS)
    given = ca.SX.sym("r"), ca.SX.sym("p", len(symbols) - 1)
    return ca.Function(
        "half_turn", given, [to_casadi(form, symbols)(given[0], *ca.vertsplit(given[1]))]
    )


def _approximate():
    """The sech^2 profile, with gamma by the speed, and the tent, as functions exported by name."""
    import sympy as sp

    from derivations import waves

    ratio = sp.Symbol("ratio")
    gamma_squared = waves.gamma_squared().subs(waves.speed, ratio * waves.acoustic_speed)
    sech2 = waves.sech_strain().subs(waves.gamma, sp.sqrt(sp.simplify(gamma_squared)))
    profiles = {
        "sech2": (sech2, (waves.stiffness, waves.slope, ratio, waves.position)),
        "tent": (waves.tent(), (waves.stroke, waves.position)),
    }
    for name, (strain, symbols) in profiles.items():
        form = (strain * waves.spacing).subs(waves.spacing, 1)
        given = [ca.SX.sym(str(symbol)) for symbol in symbols]
        value = to_casadi(form, symbols)(*given)
        takes = ", ".join(f"real x{k}" for k in range(len(given)))
        gives = ", ".join(f"&x{k}" for k in range(len(given)))
        hook = (
            f'__attribute__((export_name("{name}"))) real {name}({takes}) {{ real y; '
            f"const real *arg[] = {{{gives}}}; real *res[] = {{&y}}; "
            f"{name}_of(arg, res, 0, 0, 0); return y; }}"
        )
        yield ca.Function(f"{name}_of", given, [value]), hook


def program_text(name: str, program: dict) -> str:
    """A program as a C function of long doubles."""
    import mpmath

    lines = []
    steps = program["steps"]

    def whole(k):
        kind, *numbers = steps[k]
        return numbers[0] if kind == "Ratio" and numbers[1] == 1 else None

    for k, (kind, *of) in enumerate(steps):
        names = [f"x{i}" for i in of]
        if kind == "Given":
            value = f"given[{of[0]}]"
        elif kind == "Ratio":
            value = f"(long double){of[0]} / {of[1]}"
        elif kind == "Pi":
            with mpmath.workdps(40):
                value = f"{mpmath.nstr(+mpmath.pi, 40)}L"
        elif kind in ("Add", "Mul"):
            value = (" + " if kind == "Add" else " * ").join(names)
        elif kind == "Pow" and whole(of[1]) is not None:
            power = whole(of[1])
            product = " * ".join([names[0]] * abs(power))
            value = product if power > 0 else f"1 / ({product})"
        elif kind == "Pow":
            value = f"powl({names[0]}, {names[1]})"
        else:
            value = f"{kind}l({', '.join(names)})"
        lines.append(f"    const long double x{k} = {value};")
    lines += [f"    found[{i}] = x{k};" for i, k in enumerate(program["results"])]
    body = "\n".join(lines)
    return f"static void {name}(const long double *given, long double *found)\n{{\n{body}\n}}"


def net_text(laws) -> str:
    """The C of networks in the plane."""
    return "\n".join([EXPORT, c_text(laws, dim=2), (FOLDER / "net.c").read_text()])


def wasm(source_text: str, *flags: str) -> bytes:
    """C of the page, compiled."""
    with tempfile.TemporaryDirectory() as folder:
        source, made = Path(folder) / "live.c", Path(folder) / "live.wasm"
        source.write_text(source_text)
        command = [
            sys.executable,
            "-m",
            "ziglang",
            "cc",
            *FLAGS,
            *flags,
            str(source),
            "-o",
            str(made),
        ]
        answer = subprocess.run(command, capture_output=True, text=True, timeout=600)
        if answer.returncode:
            raise RuntimeError(f"{' '.join(command[:4])} failed: {answer.stderr[-2000:]}")
        return made.read_bytes()
