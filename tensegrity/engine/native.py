"""Compile generated C, keep the result in a private cache, load it; structures that C takes.

An entry of the cache is a folder named by the hash of all that decides its content (text,
compiler, flags, processor).  It is built beside and renamed, so it is either whole or absent;
its library is checked against a digest before the process loads it.  The fields of structures are
read from the C text.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import platform
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from tensegrity.engine.disk_cache import cache_folder, cached, size_limit, trim, use
from tensegrity.errors import CompilerError
from tensegrity.once import once

# -fno-semantic-interposition: else CasADi's helpers, which have external linkage, stay calls.
# -fno-math-errno -fno-trapping-math: else sqrt and comparisons keep the loops scalar.
# -ffp-contract=fast: CasADi writes one operation a statement; contract across statements.
# Not -ffast-math: loading such a library changes the arithmetic of the whole process.
FLAGS = (
    "-O3",
    "-fPIC",
    "-shared",
    "-fno-semantic-interposition",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=fast",
)
NATIVE = "-march=native"
WIDE = ("-mprefer-vector-width=512",) if platform.machine() in ("x86_64", "AMD64") else ()

RENAMES = 50
LIMIT = 120.0  # s: a compiler that takes longer hangs, or would slow down all that it serves
LIBRARY, DIGEST, SOURCE = "kernel.so", "kernel.sha256", "kernel.c"


hung = set()  # compilers that took longer than LIMIT: not asked again by this process


def address(array):
    """Where an array's numbers are: `array.ctypes.data` in half the time."""
    try:
        return ctypes.addressof(_first_byte(array))
    except (TypeError, ValueError):  # read-only, not in a row, or empty
        return array.ctypes.data


_first_byte = ctypes.c_char.from_buffer


def pointer(function):
    """The address of a function of a library, or of one of Python that C may call."""
    return ctypes.cast(function, ctypes.c_void_p).value


def compilers():
    """Commands to try, in order: $CC alone where it is set, else cc, gcc, clang, zig's."""
    given = os.environ.get("CC", "").strip()
    if given:
        try:
            return (tuple(shlex.split(given)),)
        except ValueError as error:
            raise CompilerError(f"CC {given!r}: {error}") from None
    found = tuple((path,) for name in ("cc", "gcc", "clang") if (path := shutil.which(name)))
    if not found and _has_zig():
        found = ((sys.executable, "-m", "ziglang", "cc"),)
    return found


@cache
def require():
    """Refuse to step in time where nothing can be compiled; once it can, it is not asked again.

    Raises
    ------
    CompilerError
    """
    try:
        library("int tensegrity_probe;")
    except CompilerError as error:
        reason = " ".join(str(error).split())
        raise CompilerError(
            f"time stepping needs a C compiler: {reason}; `pip install ziglang`, or install gcc or "
            "clang, or set CC"
        ) from None


def described():
    """The compiler that kernels are made with: its command, and its first line on itself."""
    for command in compilers():
        identity = _identity(command)
        if identity is not None and command not in hung:
            return f"{shlex.join(command)}: {identity.splitlines()[0] if identity else ''}"
    raise CompilerError("no C compiler found, or none that can be run")


def _has_zig():
    from importlib.util import find_spec

    return find_spec("ziglang") is not None


@cache
def _identity(command):
    """What `command --version` says, or None where it cannot be run.

    It is kept for a compiler that is one file, as long as that has the same size and time.
    """
    try:
        path = os.path.realpath(shutil.which(command[0]) or "")
        state = os.stat(path)
    except OSError:
        return None
    if len(command) > 1:
        return _output_of(command)
    parts = "compiler", command[0], path, state.st_size, state.st_mtime_ns
    return cached(parts, lambda: _output_of(command))


def _output_of(command):
    try:
        code, said = _call((*command, "--version"), subprocess.DEVNULL)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return None if code else said


def _call(command, errors=subprocess.STDOUT):
    """Exit code and output of a command; all that it started is ended with it after `LIMIT`.

    The output goes to a file: of a pipe, what outlives the command could keep the end open.
    """
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=said, stderr=errors, start_new_session=True
        )
        try:
            code = process.wait(LIMIT)
        except BaseException:  # also Ctrl-C, which a group of its own does not hear
            _end(process)
            raise
        said.seek(0)
        return code, said.read().decode(errors="replace")


def _end(process):
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()


@cache
def _processor():
    """The processor's model and features: code for one model may not run on another."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() + platform.machine()
    kept = ("vendor_id", "cpu family", "model", "flags", "Features", "CPU part")
    return "\n".join(sorted({line for line in lines if line.startswith(kept)}))


def library(text, extra_flags=()):
    """Compile C text, or find it compiled, and load it.

    Parameters
    ----------
    text : str
        C source.
    extra_flags : sequence of str
        Added to the usual flags, for instance a macro definition.

    Returns
    -------
    ctypes.CDLL
        Calls into it release the interpreter's lock; its functions take and give what the text
        declares.

    Raises
    ------
    CompilerError
        Where no compiler can be run, or all refuse the text or hang; with their last lines.
    """
    complaints = []
    for command in compilers():
        if command in hung:
            complaints.append(f"{shlex.join(command)} was ended after {LIMIT:g} s")
            continue
        identity = _identity(command)
        if identity is None:
            complaints.append(f"{shlex.join(command)} cannot be run")
            continue
        for flags in ((*FLAGS, NATIVE, *WIDE), (*FLAGS, NATIVE), FLAGS):
            try:
                return _declared(_load(text, command, identity, (*flags, *extra_flags)), text)
            except CompilerError as error:
                complaint = str(error)
                if command in hung:
                    break
        complaints.append(complaint)
    raise CompilerError("; ".join(complaints) or "no C compiler found")


DECLARED = re.compile(
    r"^(?:__attribute__\(\(\w+\)\) )?(void|integer) (\w+)\(([^()]*)\)", re.MULTILINE
)


def joined(parts):
    """C of parts, each a text or the name of a file of the engine, whose lines messages name."""
    folder = files(__package__)
    return "\n".join(
        f'#line 1 "{part}"\n{folder.joinpath(part).read_text()}'
        if part.endswith((".c", ".h")) else part for part in parts
    )  # fmt: skip


def _declared(found, text):
    """A library whose functions have the arguments of their declarations, at the begin of lines."""
    for gives, name, takes in DECLARED.findall(text):
        function = getattr(found, name, None)
        if function is not None:
            function.restype = ctypes.c_longlong if gives == "integer" else None
            function.argtypes = [_kind(one) for one in takes.split(",") if one not in ("", "void")]
    return found


def _kind(declared):
    if "*" in declared:
        return ctypes.c_void_p
    return ctypes.c_double if "double" in declared else ctypes.c_longlong


def _load(text, command, identity, flags):
    parts = (text, shlex.join(command), identity, " ".join(flags), _processor())
    key = hashlib.sha256("\0".join(parts).encode()).hexdigest()
    entry = cache_folder() / key
    use(entry)  # first: what is in use is not removed between the look at it and its loading
    if not _intact(entry):
        most = size_limit()
        try:
            build(text, command, flags, entry)
        except OSError as error:
            raise CompilerError(f"{entry.parent} takes no kernel: {error.strerror}") from error
        trim(most)
    try:
        return ctypes.CDLL(str(entry / LIBRARY))
    except OSError as error:
        raise CompilerError(f"{shlex.join(command)} made what cannot be loaded: {error}") from error


def _intact(entry):
    """Whether an entry is there and its library is the one that was built."""
    try:
        digest = hashlib.sha256((entry / LIBRARY).read_bytes()).hexdigest()
        return digest.encode() == (entry / DIGEST).read_bytes()
    except OSError:
        return False


def build(text, command, flags, entry):
    """Compile into a folder beside the entry, then rename it there."""
    entry.parent.mkdir(mode=0o700, parents=True, exist_ok=True)  # it may have been deleted
    beside = Path(tempfile.mkdtemp(prefix="build-", dir=entry.parent))
    try:
        source, made = beside / SOURCE, beside / LIBRARY
        source.write_text(text)
        try:
            code, said = _call((*command, *flags, str(source), "-o", str(made), "-lm"))
        except subprocess.TimeoutExpired:
            hung.add(command)
            raise CompilerError(f"{shlex.join(command)} was ended after {LIMIT:g} s") from None
        if code or not made.is_file():
            last = "\n".join(said.strip().splitlines()[-5:])
            raise CompilerError(f"{shlex.join(command)} failed ({code}): {last}")
        (beside / DIGEST).write_text(hashlib.sha256(made.read_bytes()).hexdigest())
        for _ in range(RENAMES):
            if _intact(entry):  # here, or in another process that finished first
                return
            _discard(entry)
            with contextlib.suppress(OSError):  # it is there by now: look again
                os.rename(beside, entry)
        raise CompilerError(f"{entry} could not be put in place in {RENAMES} attempts")
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _discard(entry):
    """Move a damaged entry out of the way; an intact one, just finished elsewhere, stays."""
    if entry.exists() and not _intact(entry):
        aside = Path(tempfile.mkdtemp(prefix="damaged-", dir=entry.parent))
        with contextlib.suppress(OSError):  # somebody else was quicker
            os.rename(entry, aside / entry.name)
        shutil.rmtree(aside, ignore_errors=True)


_NUMBERS = {"integer": ctypes.c_longlong, "double": ctypes.c_double}


class Structure(ctypes.Structure):
    """A structure of C, all of whose fields are given by name.

    Parameters
    ----------
    values : ndarray, Structure, int, float or None
        For a pointer an array or a structure, of which C gets the address, or an address; None
        leaves a field as it is, 0 at first.

    Attributes
    ----------
    kinds : dict of str
        Types of all fields.
    filled : dict of str
        The values given, which live as long as C may look at them.

    Raises
    ------
    TypeError
        Names are missing, or unknown.
    """

    __slots__ = ("filled",)
    kinds: ClassVar[dict[str, Any]]

    def __init__(self, **values: Any) -> None:
        if wrong := values.keys() ^ self.kinds.keys():
            raise TypeError(
                f"{', '.join(sorted(wrong))} of {type(self).__name__}: missing or unknown"
            )
        self.filled: dict[str, Any] = {}
        self.fill(**values)

    @classmethod
    def of(cls, **values: int) -> Self:
        """One of numbers and addresses alone, of some fields; the others are 0."""
        made = cls.__new__(cls)
        ctypes.Structure.__init__(made, **values)
        return made

    def fill(self, **values: Any) -> None:
        """Give some fields other values."""
        self.filled |= values
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value = address(value)
            elif isinstance(value, Structure) and self.kinds[name] is ctypes.c_void_p:
                value = ctypes.addressof(value)
            if value is not None:
                setattr(self, name, value)


@once
def structure(file: str, name: str) -> Any:
    """The `Structure` that a file of the engine declares as `typedef struct {...} name;`."""
    text = files(__package__).joinpath(file).read_text()
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    text = re.sub(r"\(\*(\w+)\)\([^()]*\)", r"*\1", text)  # functions, as other pointers
    (body,) = re.findall(rf"typedef struct \{{([^{{}}]*)\}} {name};", text)
    kinds: dict[str, Any] = {}
    for kind, names in re.findall(r"(?:const )?(?:unsigned )?(\w+) ([^;]*);", body):
        for one in names.split(","):
            found = ctypes.c_void_p if "*" in one else _NUMBERS.get(kind) or structure(file, kind)
            kinds[one.strip(" *\n")] = found
    made = {"__slots__": (), "kinds": kinds, "_fields_": list(kinds.items())}
    return type(name, (Structure,), made)
