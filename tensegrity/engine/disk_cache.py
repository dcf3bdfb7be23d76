"""The cache on disk: a private folder of compiled kernels, and of texts and numbers.

The results of SymPy and CasADi that take seconds to derive are texts and numbers.  Each is stored
in a JSON file named by the hash of all it depends on: its key, the sources that derive it and the
packages that do the algebra.  Files are written under a temporary name and renamed; a file that is
truncated or changed does not match the digest in its first line and is derived again.  Nothing in a
file is evaluated, and C text from it is compiled only if its digest is correct.  The values of
known laws come with the package, in `derived.gz`, which `make derived` writes and which counts as
long as it was made by these sources.

The size of the folder is limited, $TENSEGRITY_CACHE_MB: after each compilation the least recently
used entries are removed.  A process holds a shared lock on each kernel that it has loaded, one byte
of a lock file, until it ends; entries that are locked or were used in the last minutes stay.
"""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import json
import os
import shutil
import stat
import sys
import tempfile
import threading
import time
import warnings
import zlib
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.once import undisturbed

try:
    import fcntl
except ImportError:  # without locks, entries in use are protected by their age only
    fcntl = None  # type: ignore[assignment]

SOURCES = ("derivations", "tensegrity.engine", "tensegrity.springs", "tensegrity.branches",
           "tensegrity.unit", "tensegrity.prisms")  # fmt: skip
ALGEBRA = ("sympy", "mpmath", "casadi")
MACHINE = ("('compiler'", "('intrinsics'")  # keys of values that hold for one machine only
SHIPPED = Path(__file__).with_name("derived.gz")
MOST = "500"  # MB
YOUNG = 600.0  # s since the last use, within which no entry is removed
LOCKS = "locks"
WAIT = 0.01  # s between two attempts to lock

BUILDS = 1 << 32  # where the bytes of the lock file begin that are locked while an entry is built

_builders: dict[str, threading.Lock] = {}  # one for each entry that is built
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_builders.clear)
loaded = set()  # names of the entries that this process uses, which its own locks do not protect


def cached(parts, make):
    """A value of texts and numbers from the cache, or else computed and stored there.

    Parameters
    ----------
    parts : tuple, or None
        Key of the value, by its `repr`, besides sources and packages; None for no caching.
    make : callable () -> dict, list, str, number or None
        Computes the value; None is not stored.

    Returns
    -------
    dict, list, str, number or None
        The value after conversion to JSON and back: tuples are lists.
    """
    makers = made_by()
    if parts is None or makers is None:
        with undisturbed():
            return json.loads(json.dumps(make()))
    key = repr(parts) + makers
    path = cache_folder() / f"{_digest(key)}.json"
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        digest, _, content = path.read_bytes().partition(b"\n")
        if digest == hashlib.sha256(content).hexdigest().encode():
            entry = json.loads(content)
            if entry["of"] == key:
                _touch(path)
                return entry["value"]
    given = shipped().get(_digest(repr(parts)))
    with undisturbed():
        value = make() if given is None else json.loads(given)
    content = json.dumps({"of": key, "value": value})
    if value is not None:
        _write(path, content.encode())
    return json.loads(content)["value"]


def _digest(text):
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def shipped():
    """Values that come with the package, {digest of the key: JSON}; none of other sources."""
    with contextlib.suppress(OSError, ValueError):
        head, *lines = gzip.decompress(SHIPPED.read_bytes()).decode().splitlines()
        if head == sources():
            return dict(line.split(" ", 1) for line in lines)
    return {}


def write_shipped(entries):
    """Write the values that come with the package.

    Parameters
    ----------
    entries : sequence of dict
        Contents of the files of a cache.
    """
    lines = [
        f"{_digest(one['of'].removesuffix(made_by()))} {json.dumps(one['value'])}"
        for one in entries if not one["of"].startswith(MACHINE)
    ]  # fmt: skip
    text = "\n".join([sources(), *sorted(lines)])
    SHIPPED.write_bytes(gzip.compress(text.encode(), mtime=0))


def _write(path, content):
    """Write a file completely, or not at all if this is not possible."""
    with contextlib.suppress(OSError):
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)  # it may have been deleted
        handle, temporary = tempfile.mkstemp(prefix="kept-", dir=path.parent)
        try:
            with open(handle, "wb") as file:
                file.write(hashlib.sha256(content).hexdigest().encode() + b"\n" + content)
            os.replace(temporary, path)
        except BaseException:
            os.unlink(temporary)
            raise


def size_limit():
    """Largest size of the folder [bytes]: $TENSEGRITY_CACHE_MB, or 500 MB."""
    given = os.environ.get("TENSEGRITY_CACHE_MB", "").strip() or MOST
    if not (given.isascii() and given.isdigit()):
        raise TensegrityError(
            f"TENSEGRITY_CACHE_MB {check.shown(given)} must be a whole number, at least 0"
        )
    return int(given) * 1_000_000


def use(entry):
    """Update the time of last use of an entry, and lock it until this process ends."""
    loaded.add(entry.name)
    _touch(entry)
    with contextlib.suppress(OSError):
        _lock(entry, "LOCK_SH")


@contextlib.contextmanager
def building(entry):
    """Wait until no other thread builds an entry, and no other process if files can be locked."""
    with _builders.setdefault(entry.name, threading.Lock()):
        with contextlib.suppress(OSError):
            while not _locked(entry):  # waiting in the system, threads of two processes could
                time.sleep(WAIT)  # wait for each other
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                _lock(entry, "LOCK_UN", first=BUILDS)


def _locked(entry):
    """Lock an entry while it is built; False where another process has locked it."""
    try:
        _lock(entry, "LOCK_EX", "LOCK_NB", first=BUILDS)
    except BlockingIOError:
        return False
    return True


def trim(most, age=YOUNG):
    """Remove the least recently used entries until the folder is below a size.

    Parameters
    ----------
    most : int
        Largest size of the folder [bytes].
    age : float, optional
        Entries used within so many seconds stay [s]; incomplete ones within `YOUNG`.

    Returns
    -------
    int
        Size of the removed entries [bytes].
    """
    files = sorted(_found())
    left, freed, now = sum(size for _, size, _ in files), 0, time.time()
    for used, size, path in files:
        unfinished = "-" in path.name
        if left - freed > most and now - used >= (YOUNG if unfinished else age) and _removed(path):
            freed += size
    return freed


def _found():
    """Time of last use [s], size [bytes] and path of each entry of the folder."""
    for path in cache_folder().iterdir():
        with contextlib.suppress(OSError):  # removed by another process
            parts = list(path.iterdir()) if path.is_dir() else [path]
            if path.name != LOCKS:
                yield path.stat().st_mtime, sum(part.stat().st_size for part in parts), path


def _removed(path):
    """Remove an entry that no process uses; False where it stays."""
    if path.name in loaded:
        return False
    try:
        _lock(path, "LOCK_EX", "LOCK_NB")
        try:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        finally:
            _lock(path, "LOCK_UN")
    except OSError:
        return False
    return True


def _lock(path, *kinds, first=0):
    """Lock or unlock the byte of the lock file that belongs to a path, of those from `first` on."""
    if fcntl is not None:
        kind = sum(getattr(fcntl, name) for name in kinds)
        fcntl.lockf(_locks(path.parent), kind, 1, first + zlib.crc32(path.name.encode()))


@cache
def _locks(folder):
    """The lock file, which stays open: closing it would release all locks of this process."""
    return os.open(folder / LOCKS, os.O_RDWR | os.O_CREAT, 0o600)


def _touch(path):
    with contextlib.suppress(OSError):
        os.utime(path)


def maker(make, *arguments):
    """Identifier of a call of a module's function with texts, numbers, and functions of that
    module: names, and a digest of the module's source."""
    given = ", ".join(getattr(x, "__qualname__", repr(x)) for x in arguments)
    return f"{make.__module__}.{make.__qualname__}({given}) {_source(make.__module__)}"


@cache
def _source(module):
    return hashlib.sha256(Path(sys.modules[module].__file__).read_bytes()).hexdigest()


@cache
def sources():
    """Digest of the sources that derive cached values; None without sources."""
    digest = hashlib.sha256()
    for package in SOURCES:
        folder = Path(find_spec(package).origin or "").parent
        files = sorted(p for p in folder.glob("*") if p.suffix in (".py", ".c", ".h"))
        if not files:
            return None
        for path in files:
            digest.update(f"\0{package} {path.name}\0".encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def made_by():
    """Digest of the sources and packages that derive cached values; None without sources."""
    of_sources = sources()
    if of_sources is None:
        return None
    digest = hashlib.sha256(of_sources.encode())
    for package in ALGEBRA:  # by the installed files, without an import
        of = None
        with contextlib.suppress(ValueError, AttributeError, TypeError):
            origin = find_spec(package).origin
            state = os.stat(origin)
            of = origin, state.st_size, state.st_mtime_ns
        digest.update(f"\0{package} {of}".encode())
    return digest.hexdigest()


@cache
def cache_folder():
    """Folder for compiled kernels, owned by this user and writable by nobody else.

    $XDG_CACHE_HOME/tensegrity or ~/.cache/tensegrity; where that cannot be made or is writable by
    others, a temporary folder for this process only, with a warning.
    """
    root = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(root):  # the XDG specification: a relative one is to be ignored
        root = os.path.join(os.path.expanduser("~"), ".cache")
    if not os.path.isabs(root):
        return _temporary_folder("no home folder is known; set HOME or XDG_CACHE_HOME")
    folder = Path(root) / "tensegrity"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        _refuse_open(folder)
        with tempfile.TemporaryFile(dir=folder):
            pass
        return folder
    except OSError as error:
        return _temporary_folder(f"{folder}: {error.strerror or error}")


def _refuse_open(folder):
    if hasattr(os, "getuid"):
        state = folder.stat()
        if state.st_uid != os.getuid():
            raise PermissionError(f"it belongs to user {state.st_uid}, not to {os.getuid()}")
        if state.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            raise PermissionError(f"others can write here (mode {stat.S_IMODE(state.st_mode):o})")


def _temporary_folder(reason):
    import atexit

    folder = Path(tempfile.mkdtemp(prefix="tensegrity-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    warnings.warn(
        f"compiled kernels are stored in {folder} until this process ends, because the cache "
        f"folder cannot be used: {reason}",
        RuntimeWarning,
        stacklevel=2,
    )
    return folder
