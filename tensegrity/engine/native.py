"""Compile generated C, cache and load the libraries; the structures that C functions take.

An entry of the cache is a folder named by the hash of all that its content depends on (text,
compiler, flags, processor).  It is built in a temporary folder and renamed, so it is either
complete or absent; its library is checked against a digest before it is loaded.  The fields of
structures are read from the C text.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import math
import os
import platform
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from tensegrity.engine.disk_cache import building, cache_folder, cached, size_limit, trim, use
from tensegrity.engine.intrinsics import shortened
from tensegrity.errors import CompilerError
from tensegrity.once import once

# -ftree-vectorize -fvect-cost-model=dynamic: GCC 12's -O2 alone leaves sums scalar; with these its
# results equal those of -O3 to the bit, in half the time.
# -fno-semantic-interposition: inlines CasADi's helpers, which have external linkage.
# -fno-math-errno -fno-trapping-math: let loops with sqrt and comparisons be vectorised.
# -ffp-contract=fast: CasADi writes one operation per statement; contract across statements.
# Not -ffast-math: loading such a library changes the arithmetic of the whole process.
FLAGS = (
    "-O2",
    "-ftree-vectorize",
    "-fPIC",
    "-shared",
    "-fno-semantic-interposition",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=fast",
    "-Werror=implicit-function-declaration",
)
OF_GCC = "-fvect-cost-model=dynamic"  # which zig refuses
NATIVE = "-march=native"
WIDE = ("-mprefer-vector-width=512",) if platform.machine() in ("x86_64", "AMD64") else ()
ATTEMPTS = (*FLAGS, OF_GCC, NATIVE, *WIDE), (*FLAGS, NATIVE, *WIDE), (*FLAGS, NATIVE), FLAGS

CACHE = 8  # numbers in a cache line
RENAMES = 50
LIMIT = 120.0  # s: a compiler that takes longer is ended, and not used again
LIBRARY, DIGEST, SOURCE = "kernel.so", "kernel.sha256", "kernel.c"

timed_out = set()  # compilers that took longer than LIMIT in this process
_first_byte = ctypes.c_char.from_buffer


def address(array):
    """Address of the data of an array: `array.ctypes.data` in half the time."""
    try:
        return ctypes.addressof(_first_byte(array))
    except (TypeError, ValueError):  # read-only, not contiguous, or empty
        return array.ctypes.data


def aligned(shape, dtype=float, first=0):
    """Zeros that begin a cache line: vectors of a loop that straddle two lines take longer, above
    all to be loaded right after they were stored.

    Parameters
    ----------
    shape : int or tuple of int
    dtype : numpy.dtype, optional
    first : int, optional
        Number of the entry that begins the line.

    Returns
    -------
    ndarray
    """
    size = math.prod(shape) if isinstance(shape, tuple) else shape
    room = np.zeros(size + CACHE, dtype=dtype)
    return room[-(address(room) // room.itemsize + first) % CACHE :][:size].reshape(shape)


def aligned_copy(array, first=0):
    """A copy of an array in such a place."""
    made = aligned(array.shape, array.dtype, first)
    made[...] = array
    return made


def pointer(function):
    """Address of a function of a library, or of a Python function for C to call."""
    return ctypes.cast(function, ctypes.c_void_p).value


def compilers():
    """Commands to try, in order: $CC alone where it is set, otherwise cc, gcc, clang, zig's."""
    given = os.environ.get("CC", "").strip()
    if given:
        try:
            return (tuple(shlex.split(given)),)
        except ValueError as error:
            raise CompilerError(f"CC {given!r}: {error}") from None
    commands = tuple((path,) for name in ("cc", "gcc", "clang") if (path := shutil.which(name)))
    if not commands and _has_zig():
        commands = ((sys.executable, "-m", "ziglang", "cc"),)
    return commands


@cache
def require():
    """Refuse time integration without a working compiler; a success is remembered.

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
    """The compiler in use: its command, and the first line of its version."""
    for command in compilers():
        identity = _identity(command)
        if identity is not None and command not in timed_out:
            return f"{shlex.join(command)}: {identity.splitlines()[0] if identity else ''}"
    raise CompilerError("no C compiler found, or none that can be run")


def _has_zig():
    from importlib.util import find_spec

    return find_spec("ziglang") is not None


@cache
def _identity(command):
    """Output of `command --version`, or None where it cannot be run.

    It is cached for a compiler that is a single file, while its size and time do not change.
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
        code, output = _call((*command, "--version"), subprocess.DEVNULL)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return None if code else output


def _call(command, errors=subprocess.STDOUT):
    """Exit code and output of a command, which is ended after `LIMIT` with all its subprocesses.

    The output goes to a file, as a subprocess that survives could keep a pipe open.
    """
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=errors, start_new_session=True
        )
        try:
            code = process.wait(LIMIT)
        except BaseException:  # also Ctrl-C, which does not reach a separate process group
            _end(process)
            raise
        output.seek(0)
        return code, output.read().decode(errors="replace")


def _end(process):
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()


@cache
def _processor():
    """Model and features of the processor: code for one model may not run on another."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() + platform.machine()
    names = ("vendor_id", "cpu family", "model", "flags", "Features", "CPU part")
    return "\n".join(sorted({line for line in lines if line.startswith(names)}))


def library(text, extra_flags=()):
    """Compile C text, or find it compiled, and load it.

    Parameters
    ----------
    text : str
        C source.
    extra_flags : sequence of str
        Additional flags, for instance a macro definition.

    Returns
    -------
    ctypes.CDLL
        Calls into it release the interpreter's lock; its functions have the argument and result
        types that the text declares.

    Raises
    ------
    CompilerError
        No compiler can be run, or all reject the text or time out; with their last lines.
    """
    complaints = []
    for command in compilers():
        if command in timed_out:
            complaints.append(f"{shlex.join(command)} was ended after {LIMIT:g} s")
            continue
        identity = _identity(command)
        if identity is None:
            complaints.append(f"{shlex.join(command)} cannot be run")
            continue
        for flags in ATTEMPTS:
            try:
                return _declared(_load(text, command, identity, (*flags, *extra_flags)), text)
            except CompilerError as error:
                complaint = str(error)
                if command in timed_out:
                    break
        complaints.append(complaint)
    raise CompilerError("; ".join(complaints) or "no C compiler found")


DECLARED = re.compile(
    r"^(?:__attribute__\(\(\w+\)\) )?(void|integer) (\w+)\(([^()]*)\)", re.MULTILINE
)


def concatenated(parts):
    """C text of parts, each a text or the name of a file of the engine, with line directives."""
    folder = files(__package__)
    return "\n".join(
        f'#line 1 "{part}"\n{folder.joinpath(part).read_text()}'
        if part.endswith((".c", ".h")) else part for part in parts
    )  # fmt: skip


def _declared(handle, text):
    """A library with argument and result types set from the declarations in its text."""
    for gives, name, takes in DECLARED.findall(text):
        function = getattr(handle, name, None)
        if function is not None:
            function.restype = ctypes.c_longlong if gives == "integer" else None
            function.argtypes = [_kind(one) for one in takes.split(",") if one not in ("", "void")]
    return handle


def _kind(declared):
    if "*" in declared:
        return ctypes.c_void_p
    return ctypes.c_double if "double" in declared else ctypes.c_longlong


def _load(text, command, identity, flags):
    parts = (text, shlex.join(command), identity, " ".join(flags), _processor())
    key = hashlib.sha256("\0".join(parts).encode()).hexdigest()
    entry = cache_folder() / key
    use(entry)  # first, so that another process does not remove it before it is loaded
    if not _intact(entry):
        most = size_limit()
        try:
            with building(entry):
                if not _intact(entry):  # nobody else has built it meanwhile
                    call = partial(_call, errors=subprocess.DEVNULL)
                    short = shortened(text, command, flags, identity, call)
                    _build_either(short, text, command, flags, entry)
        except OSError as error:
            raise CompilerError(
                f"a kernel cannot be stored in {entry.parent}: {error.strerror}"
            ) from error
        trim(most)
    try:
        return ctypes.CDLL(str(entry / LIBRARY))
    except OSError as error:
        raise CompilerError(
            f"the library made by {shlex.join(command)} cannot be loaded: {error}"
        ) from error


def _build_either(short, text, command, flags, entry):
    """Build an entry from a text with the short header, or else with the whole one."""
    try:
        build(short, command, flags, entry)
    except CompilerError:
        if short == text or command in timed_out:
            raise
        build(text, command, flags, entry)


def _intact(entry):
    """Whether an entry exists and its library is the one that was built."""
    try:
        digest = hashlib.sha256((entry / LIBRARY).read_bytes()).hexdigest()
        return digest.encode() == (entry / DIGEST).read_bytes()
    except OSError:
        return False


def build(text, command, flags, entry):
    """Compile in a temporary folder and rename it to the entry of the cache.

    Parameters
    ----------
    text : str
        C source.
    command, flags : tuple of str
        Of the compiler.
    entry : Path

    Raises
    ------
    CompilerError
        The compiler rejects the text or times out, or the entry cannot be put in place.
    """
    entry.parent.mkdir(mode=0o700, parents=True, exist_ok=True)  # it may have been deleted
    temporary = Path(tempfile.mkdtemp(prefix="build-", dir=entry.parent))
    try:
        source, made = temporary / SOURCE, temporary / LIBRARY
        source.write_text(text)
        try:
            code, output = _call((*command, *flags, str(source), "-o", str(made), "-lm"))
        except subprocess.TimeoutExpired:
            timed_out.add(command)
            raise CompilerError(f"{shlex.join(command)} was ended after {LIMIT:g} s") from None
        if code or not made.is_file():
            last = "\n".join(output.strip().splitlines()[-5:])
            raise CompilerError(f"{shlex.join(command)} failed ({code}): {last}")
        (temporary / DIGEST).write_text(hashlib.sha256(made.read_bytes()).hexdigest())
        for _ in range(RENAMES):
            if _intact(entry):  # here, or in another process that finished first
                return
            _discard(entry)
            with contextlib.suppress(OSError):  # another process made it: check again
                os.rename(temporary, entry)
        raise CompilerError(f"{entry} could not be put in place in {RENAMES} attempts")
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _discard(entry):
    """Remove a damaged entry; an intact one, made by another process meanwhile, stays."""
    if entry.exists() and not _intact(entry):
        aside = Path(tempfile.mkdtemp(prefix="damaged-", dir=entry.parent))
        with contextlib.suppress(OSError):  # another process removed it
            os.rename(entry, aside / entry.name)
        shutil.rmtree(aside, ignore_errors=True)


_NUMBERS = {"integer": ctypes.c_longlong, "double": ctypes.c_double}


class Structure(ctypes.Structure):
    """A structure of C whose fields are all given by name.

    Parameters
    ----------
    values : ndarray, Structure, int, float or None
        For a pointer an array or a structure, whose address is passed, or an address; None leaves
        a field unchanged, initially 0.

    Attributes
    ----------
    kinds : dict of str
        Types of all fields.
    filled : dict of str
        The given values, which are referenced as long as C may read them.

    Raises
    ------
    TypeError
        Names are missing or unknown.
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
        """A structure from numbers and addresses for some fields; the others are 0."""
        made = cls.__new__(cls)
        ctypes.Structure.__init__(made, **values)
        return made

    def fill(self, **values: Any) -> None:
        """Set some fields."""
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
    text = re.sub(r"\(\*(\w+)\)\([^()]*\)", r"*\1", text)  # pointers to functions
    (body,) = re.findall(rf"typedef struct \{{([^{{}}]*)\}} {name};", text)
    kinds: dict[str, Any] = {}
    for kind, names in re.findall(r"(?:const )?(?:unsigned )?(\w+) ([^;]*);", body):
        for one in names.split(","):
            field = ctypes.c_void_p if "*" in one else _NUMBERS.get(kind) or structure(file, kind)
            kinds[one.strip(" *\n")] = field
    made = {"__slots__": (), "kinds": kinds, "_fields_": list(kinds.items())}
    return type(name, (Structure,), made)
