"""What is kept beside the kernels: a fresh process derives nothing twice and trusts no file."""

import json
import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import fresh
from tensegrity import PowerLaw, Prism
from tensegrity.engine import disk_cache, programs
from tensegrity.engine.disk_cache import cache_folder, cached
from tensegrity.engine.law import DerivedLaw, functions
from tensegrity.prisms.closed import rigid_law
from tensegrity.prisms.condensed import function as condensed
from tensegrity.prisms.equations import problem

ROOT = Path(__file__).parent.parent
ALONE = "from tensegrity.engine import disk_cache; disk_cache.shipped = dict\n"
RESULTS = (
    "from tensegrity import *\n"
    "spring = Prism(1.0, 0.7, 0.1, 1.0).potential(0.01)\n"
    "soft = Prism(1.0, 0.7, 0.1, 1.0, 2.0, 20.0)\n"
    "chain = Chain(spring, 12); run = simulate(chain, chain.at_rest({0: 0.01}), 3.0, dt=0.05)\n"
    "path, flat = equilibrium_path(soft), equilibrium_path(Prism(1.0, 0.5, 0.4, 1.0))\n"
    "numbers = run.u.tobytes() + path.load.tobytes() + flat.twist.tobytes()\n"
    "numbers += soft.potential().energy([-0.1, 0.01]).tobytes()\n"
    "import hashlib, sys\n"
    "print(hashlib.sha256(numbers).hexdigest(), *[x for x in LATE if x in sys.modules])"
).replace("LATE", repr(fresh.LATE))

SIMPLIFIED = (
    "import sympy as sp\n"
    "x, y = sp.symbols('x y')\n"
    "sp.simplify(sp.sin(x) ** 2 + sp.cos(x) ** 2), sp.cancel((x**2 - y**2) / (x - y))\n"
    "from derivations import polygon\n"
    "polygon.members_condition()\n"
    "[sp.Dummy() for _ in range(20)]\n"
)
TEXTS = (
    "from tensegrity.engine.codegen import c_text\n"
    "from tensegrity.engine.law import Change\n"
    "from tensegrity.prisms.closed import rigid_law\n"
    "from tensegrity.prisms.condensed import ElasticLaw\n"
    "for law in (rigid_law(), rigid_law(True), ElasticLaw(False, 1)):\n"
    "    print(c_text((law,)), c_text((law, Change(law)), (None, None), steps='driven'))\n"
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty cache of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    cache_folder.cache_clear()
    yield tmp_path / "tensegrity"
    cache_folder.cache_clear()


def said(program, cache, seed="0"):
    """What a process prints, with a cache of its own."""
    environment = os.environ | {"XDG_CACHE_HOME": str(cache), "PYTHONHASHSEED": seed}
    answer = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, env=environment, check=True,
        capture_output=True, text=True,
    )  # fmt: skip
    assert answer.stderr == ""
    return answer.stdout


def results(cache, before=ALONE):
    """Digest of all numbers of a process, and which heavy packages it imported; without what comes
    with the package."""
    digest, *late = said(before + RESULTS, cache).split()
    return digest, late


def test_c_text_depends_neither_on_earlier_algebra_nor_on_hashes(derived, tmp_path):
    *_, text = derived
    assert len(text) > 10_000
    assert said(ALONE + SIMPLIFIED + TEXTS, tmp_path, seed="1") == text


def damage(files, kind):
    """What may befall files of the cache: each is valid in some way, and none is what it was."""
    contents = [file.read_bytes() for file in files]
    for k, (file, content) in enumerate(zip(files, contents, strict=True)):
        if kind == "deleted":
            file.unlink()
        elif kind == "cut off":
            file.write_bytes(content[: len(content) // 2])
        elif kind == "changed":
            head, value = content.rsplit(b'"value"', 1)  # still JSON, with other numbers
            other = bytes.maketrans(b"123456789", b"234567891")
            file.write_bytes(head + b'"value"' + value.translate(other))
        elif kind == "of something else":
            file.write_bytes(contents[k - 1])
        elif kind == "empty":
            file.write_bytes(b"")
        elif kind == "no text":
            file.write_bytes(b"\377\376\n\377")


@pytest.fixture(scope="module")
def derived(tmp_path_factory):
    """A cache that was empty, what the process with it gave, and C text that it wrote then."""
    folder = tmp_path_factory.mktemp("derived")
    first, _, text = said(f"{ALONE}{RESULTS}\n{TEXTS}", folder).partition("\n")
    digest, *late = first.split()
    return folder, (digest, late), text


def test_a_warm_process_imports_no_algebra_and_gives_the_same_bits(derived):
    folder, (cold, late), _ = derived
    assert set(late) >= {"sympy", "casadi"}
    assert results(folder) == (cold, [])


def test_what_comes_with_the_package_was_derived_by_its_sources_and_is_the_same(derived, tmp_path):
    """`make derived` writes it; a first call then imports no algebra and gives the same bits."""
    assert disk_cache.shipped(), "written by other sources: call `make derived`"
    assert results(tmp_path, before="") == (derived[1][0], [])


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", ["deleted", "cut off", "changed", "of something else", "empty", "no text"]
)
def test_after_any_damage_all_is_derived_anew_to_the_same_bits(kind, tmp_path):
    cold, _ = results(tmp_path)
    files = sorted((tmp_path / "tensegrity").glob("*.json"))
    assert len(files) > 10
    damage(files, kind)
    again, late = results(tmp_path)
    assert again == cold
    assert "sympy" in late
    assert results(tmp_path) == (cold, [])


@pytest.mark.parametrize(
    "kind", ["deleted", "cut off", "changed", "of something else", "empty", "no text"]
)
def test_a_value_is_made_once_and_again_after_damage(kind, folder):
    made = []

    def value(name):
        def make():
            made.append(name)
            return {"text": f"C of {name}", "numbers": [1, 0.1, float("inf")]}

        return cached(("test", name), make)

    first = value("one"), value("two")
    assert (value("one"), value("two")) == first
    assert made == ["one", "two"]
    damage(sorted(folder.glob("*.json")), kind)
    assert (value("one"), value("two")) == first
    assert made == ["one", "two", "one", "two"]
    assert (value("one"), value("two")) == first
    assert len(made) == 4


def test_files_are_private_whole_and_hold_data_only(folder):
    cached(("test",), lambda: ["x", 1.5])
    (file,) = folder.iterdir()
    assert file.stat().st_mode & 0o777 == 0o600
    digest, _, content = file.read_bytes().partition(b"\n")
    assert len(digest) == 64
    assert json.loads(content)["value"] == ["x", 1.5]


def test_a_changed_source_makes_everything_anew(folder, monkeypatch):
    """In a copy of the sources: one more line in a derivation."""
    first = disk_cache.made_by()
    assert disk_cache.made_by() == first
    source = Path(sys.modules["tensegrity"].__file__).parent / "prisms" / "prism.py"
    real = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: real(path) + b"#" * (path == source))
    cleared = disk_cache.made_by, disk_cache.sources, disk_cache.shipped
    for one in cleared:
        one.cache_clear()
    try:
        assert disk_cache.made_by() != first
        assert disk_cache.shipped() == {}
    finally:
        for one in cleared:
            one.cache_clear()


def test_a_folder_that_cannot_be_written_costs_only_time(folder, monkeypatch):
    cache_folder()

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tempfile.mkstemp", full)
    assert cached(("test",), lambda: 1) == cached(("test",), lambda: 2) - 1 == 1


def test_what_cannot_be_said_is_not_kept(folder):
    assert cached(("test",), lambda: None) is None
    assert cached(None, lambda: (1, 2)) == [1, 2]
    assert list(folder.glob("*.json")) == []


def _many(number):
    return cached(("shared",), lambda: {"by": number, "long": "x" * 100_000})["long"]


def test_processes_that_keep_the_same_value_at_once_all_get_it(folder):
    with multiprocessing.get_context("spawn").Pool(4) as pool:
        assert set(pool.map(_many, range(8))) == {"x" * 100_000}
    assert len(list(folder.glob("*"))) == 1  # nothing left beside it


def test_derived_laws_are_equal_by_what_they_are_made_of():
    law = PowerLaw(1.0, 1.5).law
    assert law == PowerLaw(2.0, 1.5).law != PowerLaw(1.0, 2.5).law
    assert hash(law) == hash(PowerLaw(2.0, 1.5).law)
    assert isinstance(rigid_law(), DerivedLaw)
    assert rigid_law() != law
    assert functions(law)["tension"].size1_in(1) == len(law.parameters) == 4


def test_problems_of_prisms_are_made_once():
    """Not at each path: their functions are read and loaded with them."""
    for kind in ((False,), (True, False), (False, True)):
        assert problem(*kind) is problem(*kind)
        assert condensed("step", *kind) is condensed("step", *kind)


def test_a_program_gives_the_numbers_of_its_expressions():
    import mpmath
    import sympy as sp

    x, y = sp.symbols("x y", positive=True)
    forms = [
        sp.sqrt(x) / (1 + y) ** 3 - sp.Rational(2, 7),
        sp.cos(x * sp.pi / 3) + sp.atan(y) ** 2,
        x ** sp.Rational(3, 2) / sp.sqrt(y),
        sp.Max(x - y, sp.Integer(0)),
    ]
    program = json.loads(json.dumps(programs.program(forms, (x, y))))
    for at in ((0.3, 1.7), (2.5, 0.4)):
        values = programs.run(program, np, at)
        exact = [float(form.evalf(30, subs={x: at[0], y: at[1]})) for form in forms]
        np.testing.assert_allclose(values, exact, rtol=1e-14)
    decimals = mpmath.MPContext()
    decimals.dps = 40
    found = programs.run(programs.program(forms[:3], (x, y)), decimals, [decimals.mpf(3)] * 2)
    for value, form in zip(found, forms[:3], strict=True):
        assert abs(value - decimals.mpf(str(form.evalf(45, subs={x: 3, y: 3})))) < 1e-38


def test_an_operation_that_is_not_listed_is_refused():
    with pytest.raises(ValueError, match="system is no operation"):
        programs.run({"steps": [["system", 0]], "results": [0]}, os, [])
    import sympy as sp

    with pytest.raises(TypeError, match="zeta"):
        programs.program([sp.zeta(sp.Symbol("x"))], (sp.Symbol("x"),))


def test_a_prism_has_the_numbers_of_its_derivation():
    """Against SymPy's own evaluation, to the last bit."""
    from derivations import prism as derived

    prism = Prism(1.3, 0.7, 0.05, 2.0, 9.0, 40.0)
    exact = derived.natural_lengths()
    known = {
        derived.base: 1.3, derived.reference_height: 0.7, derived.prestrain: 0.05,
        derived.k_cross: 2.0, derived.k_base: 9.0, derived.k_bar: 40.0,
    }  # fmt: skip
    import sympy as sp

    known = {symbol: sp.Rational(value) for symbol, value in known.items()}
    wanted = [float(form.subs(known).evalf(40)) for form in exact]
    assert list(prism.natural_lengths()) == wanted


def test_the_benchmark_measures_a_process_and_what_it_imports(tmp_path):
    spent, late = fresh.seconds(fresh.PROGRAMS["import numpy"], tmp_path)
    assert 0 < spent < 60
    assert late == []
    assert fresh.seconds("import casadi", tmp_path)[1] == ["casadi"]


def test_the_guide_of_the_readme_imports_neither_algebra_nor_scipy_once_it_was_compiled():
    program, cache = fresh.PROGRAMS["README, Beads"], cache_folder().parent
    fresh.seconds(program, cache)
    assert fresh.seconds(program, cache)[1] == []
