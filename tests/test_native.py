"""The cache of compiled kernels under every fault that is expected of it; structures of C."""

import ctypes
import errno
import multiprocessing
import os
import platform
import re
import select
import shutil
import signal
import subprocess
import sys
import time
import warnings
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from tensegrity import PowerLaw, Prism, TensegrityError
from tensegrity.__main__ import main
from tensegrity.engine import disk_cache, intrinsics, native
from tensegrity.engine.law import law_properties

COMPILER = native.compilers()[0]
TEXT = "double answer(void) { return 42; }"


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    native.cache_folder.cache_clear()
    yield tmp_path / "tensegrity"
    native.cache_folder.cache_clear()


def left(folder):
    """What compilers have left; texts that are kept beside it are files of JSON."""
    return [e for e in folder.iterdir() if e.suffix != ".json" and e.name != disk_cache.LOCKS]


def entries(folder):
    return [e for e in left(folder) if not e.name.startswith(("build-", "damaged-"))]


def answer(text=TEXT):
    import ctypes

    function = native.library(text).answer
    function.restype = ctypes.c_double
    return function()


def test_folder_is_private_and_the_second_load_compiles_nothing(cache):
    assert answer() == 42
    assert cache.stat().st_mode & 0o777 == 0o700
    (entry,) = entries(cache)
    made = [(x, x.stat().st_ctime_ns) for x in entry.iterdir()]
    assert answer() == 42
    assert made == [(x, x.stat().st_ctime_ns) for x in entry.iterdir()]


def test_another_text_or_flag_gets_another_entry(cache):
    answer()
    answer(TEXT.replace("42", "43"))
    native.library(TEXT, ["-DSOMETHING"])
    assert len(entries(cache)) == 3


DAMAGES = ["truncated", "changed", "no digest", "binary digest", "no library", "empty"]


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_entry_is_noticed_and_rebuilt(cache, damage):
    """Seen from a new process: this one has the sound library mapped."""
    answer()
    (entry,) = entries(cache)
    library = entry / native.LIBRARY
    content = library.read_bytes()
    library.unlink()
    if damage == "truncated":
        library.write_bytes(content[: len(content) // 2])
    elif damage == "changed":
        library.write_bytes(content[:-100] + bytes(100))
    elif damage == "empty":
        library.write_bytes(b"")
    elif damage == "binary digest":
        library.write_bytes(content)
        (entry / native.DIGEST).write_bytes(b"\377\376")
    elif damage == "no digest":
        library.write_bytes(content)
        (entry / native.DIGEST).unlink()
    code = f"from test_native import answer; assert answer({TEXT!r}) == 42"
    subprocess.run([sys.executable, "-c", code], check=True, env=_environment())
    assert native._intact(entry)


def _environment():
    here = os.path.dirname(__file__)
    paths = [here, os.path.dirname(here), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def _ask(barrier, results):
    barrier.wait()
    results.put(answer())


def test_sixteen_processes_asking_at_once_get_one_good_kernel(cache):
    context = multiprocessing.get_context("fork")
    barrier, results = context.Barrier(16), context.Queue()
    workers = [context.Process(target=_ask, args=(barrier, results)) for _ in range(16)]
    for worker in workers:
        worker.start()
    assert [results.get(timeout=60) for _ in workers] == [42.0] * 16
    for worker in workers:
        worker.join()
        assert worker.exitcode == 0
    (entry,) = entries(cache)
    assert native._intact(entry)
    assert len(left(cache)) == 1  # nothing left beside it


def test_a_kill_in_the_middle_of_a_build_leaves_nothing_that_is_taken_for_a_kernel(
    cache, tmp_path, monkeypatch
):
    """The compiler writes half a library and is killed with its process; the next one builds."""
    slow = tmp_path / "slowcc"
    slow.write_text(
        '#!/bin/sh\n[ "$1" = --version ] && echo slow && exit\n'
        'while [ "$1" != -o ]; do shift; done\nprintf half > "$2"; kill -KILL $PPID\n'
    )
    slow.chmod(0o755)
    code = f"from test_native import answer; answer({TEXT!r})"
    builder = subprocess.Popen(
        [sys.executable, "-c", code], env={**_environment(), "CC": str(slow)}, process_group=0
    )
    assert builder.wait() == -signal.SIGKILL
    assert list(cache.glob("build-*"))
    assert entries(cache) == []
    assert answer() == 42


def test_a_folder_that_others_can_write_is_refused(cache):
    cache.mkdir(mode=0o700)
    cache.chmod(0o777)
    with pytest.warns(RuntimeWarning, match="others can write"):
        assert answer() == 42
    assert left(cache) == []


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs users")
def test_a_folder_of_somebody_else_is_refused(cache, monkeypatch):
    cache.mkdir(mode=0o700)
    monkeypatch.setattr(os, "getuid", lambda: os.stat(cache).st_uid + 1)
    owner = os.stat(cache).st_uid
    with pytest.warns(RuntimeWarning, match=rf"it belongs to user {owner}, not to {owner + 1}"):
        assert answer() == 42


@pytest.mark.parametrize("home", [None, "beside"])
def test_without_a_home_nothing_is_written_where_the_process_stands(tmp_path, monkeypatch, home):
    """No HOME and no entry among the users leave "~" as it is; a relative folder is no better."""
    import pwd

    def nobody(_):
        raise KeyError("no such user")

    for name in ("XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    if home is not None:
        monkeypatch.setenv("HOME", home)
        monkeypatch.setenv("XDG_CACHE_HOME", home)
    monkeypatch.setattr(pwd, "getpwuid", nobody)
    monkeypatch.chdir(tmp_path)
    native.cache_folder.cache_clear()
    with pytest.warns(RuntimeWarning, match="set HOME or XDG_CACHE_HOME"):
        folder = native.cache_folder()
    native.cache_folder.cache_clear()
    assert folder.is_absolute()
    assert folder.stat().st_mode & 0o777 == 0o700
    assert list(tmp_path.iterdir()) == []


HANGS = """#!/bin/sh
[ "$1" = --version ] && echo hanging && exit
tail -f /dev/null & echo $! > {pipe}; wait
"""


class Hanging:
    """A compiler that waits for a child; we lose patience, or are interrupted, once it does."""

    def __init__(self, folder, monkeypatch):
        command, self.pipe, self.children = folder / "hangcc", folder / "pipe", []
        self.error, self.wait = subprocess.TimeoutExpired("cc", native.LIMIT), subprocess.Popen.wait
        os.mkfifo(self.pipe)
        command.write_text(HANGS.format(pipe=self.pipe))
        command.chmod(0o755)
        monkeypatch.setenv("CC", str(command))
        monkeypatch.setattr(
            subprocess.Popen, "wait", lambda process, *limit: self.waited(process, *limit)
        )

    def waited(self, process, *limit):
        if limit and "hangcc" in process.args[0] and "--version" not in process.args:
            self.children.append(os.pidfd_open(int(self.pipe.read_text())))
            raise self.error
        return self.wait(process, *limit)

    def has_ended(self):
        """Whether the one child that there was is gone."""
        with open(self.children.pop(), "rb") as child:
            return self.children == [] and bool(select.select([child], [], [], 60)[0])


@pytest.fixture
def hanging(tmp_path, monkeypatch):
    native.timed_out.clear()
    yield Hanging(tmp_path, monkeypatch)
    native.timed_out.clear()


def test_a_compiler_that_hangs_is_ended_with_all_it_started_and_not_asked_again(cache, hanging):
    for _ in range(3):
        with pytest.raises(native.CompilerError, match=r"was ended after \d+ s"):
            native.library(TEXT)
    assert hanging.has_ended()
    assert left(cache) == []


def test_an_interrupt_ends_the_compiler_too(cache, hanging):
    hanging.error = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        native.library(TEXT)
    assert hanging.has_ended()


def test_without_a_usable_folder_a_temporary_one_serves(cache, tmp_path):
    cache.write_text("a file where the folder should be")
    with pytest.warns(RuntimeWarning, match="cache folder cannot be used"):
        assert answer() == 42


def test_a_failing_compiler_says_its_last_lines(cache, tmp_path, monkeypatch):
    failing = tmp_path / "failcc"
    failing.write_text('#!/bin/sh\n[ "$1" = --version ] && exit\necho "no such luck" >&2; exit 3\n')
    failing.chmod(0o755)
    monkeypatch.setenv("CC", str(failing))
    with pytest.raises(native.CompilerError, match=r"failed \(3\): no such luck"):
        native.library(TEXT)
    assert left(cache) == []


def test_a_compiler_that_makes_what_cannot_be_loaded(cache, tmp_path, monkeypatch):
    lying = tmp_path / "liecc"
    lying.write_text(
        '#!/bin/sh\n[ "$1" = --version ] && printf "\\377" && exit\n'
        'while [ "$1" != -o ]; do shift; done\necho no library > "$2"\n'
    )
    lying.chmod(0o755)
    monkeypatch.setenv("CC", str(lying))
    with pytest.raises(native.CompilerError, match="cannot be loaded"):
        native.library(TEXT)


def test_a_command_with_an_open_quote(cache, monkeypatch):
    monkeypatch.setenv("CC", '"unclosed')
    with pytest.raises(native.CompilerError, match="quotation"):
        native.library(TEXT)


def test_a_text_that_does_not_compile_is_refused_with_the_reason(cache):
    with pytest.raises(native.CompilerError, match="error"):
        native.library("this is not C;")


def test_a_compiler_that_is_not_there(cache, monkeypatch):
    monkeypatch.setenv("CC", "/nowhere/cc")
    with pytest.raises(native.CompilerError, match="/nowhere/cc cannot be run"):
        native.library(TEXT)


@pytest.mark.parametrize(
    ("compiler", "why"),
    [("/nowhere/cc", "cannot be run"), ("false", "cannot be run"), ("", r"was ended after \d+ s")],
)
def test_steps_in_time_are_refused_in_one_line_where_nothing_compiles(
    cache, compiler, why, hanging, monkeypatch
):
    if compiler:
        monkeypatch.setenv("CC", compiler)
    native.require.cache_clear()
    words = f"needs a C compiler: .*{why}; `pip install ziglang`, or"
    with pytest.raises(TensegrityError, match=words) as one:
        native.require()
    assert "\n" not in str(one.value)


def test_compiled_code_leaves_the_arithmetic_of_the_process_alone(cache):
    """-ffast-math would flush subnormal numbers to zero in the whole process."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        answer()
    tiny = sys.float_info.min / 4
    assert tiny > 0
    assert tiny / 2 * 2 == tiny


def test_the_folder_may_be_deleted_between_two_calls(cache):
    answer()
    shutil.rmtree(cache)
    assert answer(TEXT.replace("42", "43")) == 43
    assert cache.stat().st_mode & 0o777 == 0o700


def test_a_full_disk_is_told_as_what_the_compiler_lacks(cache, monkeypatch):
    """And nothing half written stays."""

    def full(self, *_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(native.CompilerError, match=r"cannot be stored in .*: No space left"):
        native.library(TEXT)
    assert not list(cache.glob("build-*"))


def aged(folder, seconds):
    """All that is in the folder, as if it had been used so long ago."""
    for entry in folder.iterdir():
        os.utime(entry, (time.time() - seconds,) * 2)


def compile_elsewhere(texts, then=""):
    """A process that loads kernels, says so, and ends at the end of its input."""
    code = f"import sys\nfrom test_native import answer\nfor t in {texts}: answer(t)\n{then}"
    return subprocess.Popen(
        [sys.executable, "-c", code + "\nprint(1, flush=True)\nsys.stdin.read()"],
        env=_environment(),
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )


TEXTS = [TEXT.replace("42", str(number)) for number in range(3)]


def test_what_was_used_longest_ago_goes_when_something_new_is_compiled(cache, monkeypatch):
    compile_elsewhere(TEXTS).communicate()
    old, used, new = sorted(entries(cache), key=lambda entry: entry.stat().st_mtime)
    aged(cache, 2 * disk_cache.YOUNG)
    compile_elsewhere(TEXTS[1:2]).communicate()  # it is found, which counts as a use
    os.utime(old, (1, 1))
    size = sum(size for _, size, _ in disk_cache._found())
    monkeypatch.setattr(native, "size_limit", lambda: size + 100)
    answer()
    assert not old.exists()
    assert used.exists()
    assert new.exists()
    monkeypatch.setattr(native, "size_limit", lambda: 0)
    answer(TEXT.replace("42", "43"))
    assert not new.exists()
    assert used.exists()  # young


def test_nothing_is_removed_below_the_limit_or_by_a_mere_load(cache, monkeypatch):
    compile_elsewhere(TEXTS).communicate()
    aged(cache, 2 * disk_cache.YOUNG)
    answer()
    assert len(entries(cache)) == 4
    monkeypatch.setenv("TENSEGRITY_CACHE_MB", "0")
    aged(cache, 2 * disk_cache.YOUNG)
    answer()
    assert len(entries(cache)) == 4


def test_what_another_process_has_loaded_is_not_removed_before_that_ends(cache):
    process = compile_elsewhere(TEXTS[:1])
    assert process.stdout.readline() == "1\n"
    (entry,) = entries(cache)
    disk_cache.trim(0, age=0.0)
    assert native._intact(entry)
    process.communicate()
    disk_cache.trim(0, age=0.0)
    assert left(cache) == []


def test_what_a_killed_process_left_half_written_goes_when_it_is_old(cache):
    unfinished = disk_cache.cache_folder() / "build-killed"
    unfinished.mkdir()
    (unfinished / native.LIBRARY).write_text("half")
    disk_cache.trim(0, age=0.0)
    assert len(left(cache)) == 1
    aged(cache, 2 * disk_cache.YOUNG)
    disk_cache.trim(0)
    assert left(cache) == []


def test_the_cache_is_emptied_by_hand(cache, capsys):
    compile_elsewhere(TEXTS).communicate()
    size = sum(size for _, size, _ in disk_cache._found())
    assert main(["--clean"]) == 0
    assert capsys.readouterr().out == f"{size / 1e6:.1f} MB freed in {cache}\n"
    assert [entry.name for entry in cache.iterdir()] == [disk_cache.LOCKS]
    assert answer(TEXTS[0]) == 0


@pytest.mark.parametrize("given", ["-1", "1.5", "some", "\u0663"])
def test_a_size_that_is_no_whole_number_is_refused(cache, monkeypatch, given):
    monkeypatch.setenv("TENSEGRITY_CACHE_MB", given)
    with pytest.raises(TensegrityError, match=r"TENSEGRITY_CACHE_MB .* must be a whole number"):
        native.library(TEXT)


def test_processes_that_make_room_at_once_do_not_disturb_each_other(cache, monkeypatch):
    """With neither size nor age to spare, each loads what others remove and make."""
    monkeypatch.setenv("TENSEGRITY_CACHE_MB", "0")
    then = "from tensegrity.engine import disk_cache; disk_cache.trim(0, age=0.0)\n"
    started = [compile_elsewhere(TEXTS[k:] + TEXTS[:k], then) for k in range(3)]
    assert [process.communicate()[0] for process in started] == ["1\n"] * 3


# structures that C takes: read from its text, filled by name


FOLDER = files("tensegrity.engine")
PYTHON = "".join(x.read_text() for x in FOLDER.iterdir() if x.name.endswith(".py"))
USED = sorted(set(re.findall(r'structure\("(.+?)", "(\w+)"\)', PYTHON)))
DECLARED = re.compile(r"typedef struct \{[^{}]*\} \w+;")


@pytest.mark.parametrize(("file", "name"), USED)
def test_fields_are_where_the_compiler_has_them(file, name):
    made, kinds = native.structure(file, name), ("long long integer", "double real", "void law")
    text = ["#include <stddef.h>", *(f"typedef {kind};" for kind in kinds)]
    text += DECLARED.findall(FOLDER.joinpath(file).read_text())
    names = [field for field, _ in made._fields_]
    offsets = ", ".join(f"offsetof({name}, {field})" for field in names)
    text.append(f"integer found[] = {{sizeof({name}), {offsets}}};")
    found = (ctypes.c_longlong * (1 + len(names))).in_dll(native.library("\n".join(text)), "found")
    assert list(found) == [ctypes.sizeof(made), *(getattr(made, x).offset for x in names)]


def test_every_field_is_given_by_its_name_and_no_other():
    grid, begins = native.structure("energies.c", "search_grid"), np.arange(2)
    made = grid(count=1, begins=begins, fractions=None)
    assert (made.begins, made.fractions, made.count) == (begins.ctypes.data, None, 1)
    for wrong in ({"count": 1, "begins": begins}, {**made.filled, "end": 1}):
        with pytest.raises(TypeError, match=r"fractions|end"):
            grid(**wrong)
    with pytest.raises(AttributeError):
        made.fill(end=1)


def test_contacts_are_computed_in_simd_registers():
    """A root of what is positive counts as one: the processor's own takes twice the time."""
    for spring in (PowerLaw(1.0, 1.5), Prism(1.0, 0.7, 0.01, 1.0).potential()):
        assert law_properties(spring.law)["packed"]
    assert not law_properties(PowerLaw(1.0, 2.0).law)["packed"]


ASKED = (
    "import threading\n"
    "from tensegrity import Chain, PowerLaw, simulate\n"
    "chain = Chain(PowerLaw(1.0, 1.5, 0.01), 8)\n"
    "def run():\n"
    "    simulate(chain, chain.at_rest({0: 0.05}), 1.0, dt=0.02)\n"
    "threads = [threading.Thread(target=run) for _ in range(4)]\n"
    "[one.start() for one in threads]; [one.join() for one in threads]\n"
)


def test_processes_and_threads_that_ask_at_once_get_one_build_of_each_kernel(tmp_path):
    log, compiler = tmp_path / "log", tmp_path / "cc"
    compiler.write_text(f'#!/bin/sh\necho "$*" >> {log}\nexec cc "$@"\n')
    compiler.chmod(0o755)
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache"), "CC": str(compiler)}
    command = [sys.executable, "-c", ASKED]
    asked = [subprocess.Popen(command, env=environment) for _ in range(3)]
    assert [one.wait() for one in asked] == [0, 0, 0]
    built = [line for line in log.read_text().splitlines() if " -o " in line]
    kernels = list((tmp_path / "cache" / "tensegrity").glob("*/kernel.so"))
    assert 3 <= len(built) == len(kernels)


def test_a_text_that_the_short_header_does_not_serve_is_built_with_the_whole_one(cache):
    text = (
        "#include <immintrin.h>\n"
        "int tensegrity_probe; double answer(void) { return _mm_cvtsd_f64(_mm_set1_pd(42.0)); }"
    )
    assert intrinsics.INCLUDE in text
    if platform.machine() in ("x86_64", "AMD64"):
        assert answer(text) == 42
