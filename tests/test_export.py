"""Potentials as C that stands alone: compiled, it says what Python says."""

import math
import subprocess

import numpy as np
import pytest
import sympy as sp
from test_native import COMPILER

from tensegrity import EquilibriumError, Polynomial, Potential, PowerLaw, Prism, TensegrityError

R, K, A = sp.symbols("r k a")
RIGID = Prism(1.0, 0.7, 0.01, 1.0).potential()
SPRINGS = {
    "rigid": RIGID,
    "rigid, loaded": Prism(0.02, 0.018, 0.001, 5e4).potential(preload=30.0),
    "rigid, no prestrain": Prism(1.0, 0.8, 0.0, 1.0).potential(),
    "rigid, thick": Prism(1.0, 0.5, 0.1, 1.0).potential(),
    "elastic": Prism(1.0, 0.5, 0.4, 1.0, k_base=2.0, k_bar=20.0).potential(preload=0.05),
    "contact": PowerLaw(2.0, 1.5),
    "contact, loaded": PowerLaw(2.0, 1.5, preload=0.3),
    "toda": Potential(K * (sp.exp(-R) + R - 1), R, {K: 2.0}),
    "two-sided": Potential(K * R**2 / 2 + A * R**4 / 4, R, {K: 1.0, A: 0.3}, length=1.0),
    "slack": Potential(sp.Max(R + A, 0) ** 2 / 2 - A * R - A**2 / 2, R, {A: 0.1}),
    "polynomial": Polynomial(RIGID, 0.2 * RIGID.domain[0], 0.2 * RIGID.domain[1]),
}
DIFFERENCES = ("rigid, loaded", "elastic", "contact, loaded", "polynomial")
STRICT = "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror"


def compiled(source, to, *flags):
    """Compile and link by the compiler that kernels are made with; its complaints are failures."""
    command = [*COMPILER, *flags, str(source), "-o", str(to), "-lm"]
    answer = subprocess.run(command, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    return to


def printed(program, r):
    answer = subprocess.run(
        [program, *map(repr, r.tolist())], capture_output=True, text=True, check=True
    )
    head, *rows = answer.stdout.splitlines()
    assert head == "elongation,energy,tension,stiffness"
    table = np.array([row.split(",") for row in rows], dtype=float)
    assert np.array_equal(table[:, 0], r)
    return table[:, 1:].T


def elongations(spring):
    """Over the domain, close to its ends, and ever closer to the reference."""
    low, high = (math.copysign(min(abs(end), 1.0), end) for end in spring.computable_domain)
    near = 10.0 ** -np.arange(1.0, 12.0, 2.0)
    over = np.linspace(low, high, 41)[1:-1]
    ends = np.array([low, high]) * (1 - 1e-4)
    return np.concatenate([over, ends, high * near, low * near, [0.0]])


@pytest.mark.parametrize("name", SPRINGS)
def test_compiled_file_says_what_python_says(name, tmp_path):
    """To 1e-14 of each value, and of the largest where values are differences of larger ones:
    under a preload, and of sums of many terms."""
    spring = SPRINGS[name]
    path = spring.to_c(tmp_path / "my spring.c")
    r = elongations(spring)
    found = printed(compiled(path, tmp_path / "driver", "-O1", "-DDRIVER", *STRICT), r)
    wanted = np.stack([spring.energy(r), spring.tension(r), spring.stiffness(r)])
    size = np.abs(wanted)
    if name in DIFFERENCES:
        size = size.max(axis=1, keepdims=True)
    error = np.max(np.abs(found - wanted) / np.maximum(size, 1e-300), axis=1)
    assert np.all(error <= 1e-14), dict(zip(("energy", "tension", "stiffness"), error, strict=True))


CALLER = """
#include <stdio.h>
extern const double soft_lowest, hard_lowest;
double soft_tension(double r), hard_tension(double r);
int main(void)
{
    printf("%.17g %.17g %.17g %.17g\\n", soft_lowest, soft_tension(-0.05), hard_lowest,
           hard_tension(-0.05));
    return 0;
}
"""


def test_two_files_are_linked_into_a_program_of_ones_own(tmp_path):
    hard = PowerLaw(3.0, 2.5)
    sources = [RIGID.to_c(tmp_path / "soft.c"), hard.to_c(str(tmp_path / "hard.c"))]
    (tmp_path / "caller.c").write_text(CALLER)
    command = [*COMPILER, "-O1", *map(str, sources), str(tmp_path / "caller.c")]
    subprocess.run([*command, "-o", str(tmp_path / "it"), "-lm"], check=True)
    said = subprocess.run([tmp_path / "it"], capture_output=True, text=True, check=True).stdout
    wanted = RIGID.domain[0], float(RIGID.tension(-0.05)), -math.inf, float(hard.tension(-0.05))
    assert list(map(float, said.split())) == pytest.approx(wanted, rel=1e-14)


def test_driver_refuses_what_is_outside_of_the_domain(tmp_path):
    path = RIGID.to_c(tmp_path / "spring.c")
    driver = path.read_text().partition("int main")[2].partition("#endif")[0]
    assert len(driver.splitlines()) <= 20
    program = compiled(path, tmp_path / "driver", "-DDRIVER", *STRICT)
    for r in (RIGID.domain[0], RIGID.domain[1] + 1e-9, math.nan):
        answer = subprocess.run([program, repr(r)], capture_output=True, text=True)
        assert answer.returncode == 1
        assert "nan" not in answer.stdout
        assert "outside of the domain" in answer.stderr
    rows = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
    table = np.array([row.split(",") for row in rows[1:]], dtype=float)
    assert table.shape == (9, 4)
    assert np.all(np.isfinite(table))


def test_names_and_comments_hold_only_what_c_takes(tmp_path):
    odd = sp.Symbol("k */ int x; /* ??/")
    spring = Potential(odd * R**2 / 2, R, {odd: 2.0})
    path = spring.to_c(tmp_path / "9 düsen-feder*.c")
    compiled(path, tmp_path / "driver", "-DDRIVER", *STRICT)
    assert "double spring_9_d_sen_feder_energy(double r)" in path.read_text()


@pytest.mark.parametrize("stem", ["double", "null", "my--spring", "été__2", "jac"])
def test_any_name_of_a_file_makes_names_that_c_takes(stem, tmp_path):
    compiled(RIGID.to_c(tmp_path / f"{stem}.c"), tmp_path / "driver", "-DDRIVER", *STRICT)


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    path = RIGID.to_c(tmp_path / "spring.c")
    before = path.read_text()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(TensegrityError, match="No space left"):
        PowerLaw(1.0, 1.5).to_c(path)
    assert [p.name for p in tmp_path.iterdir()] == ["spring.c"]
    assert path.read_text() == before
    with pytest.raises(TensegrityError, match=r"nowhere/spring\.c cannot be written"):
        RIGID.to_c(tmp_path / "nowhere" / "spring.c")


def test_a_prism_too_stiff_for_a_few_iterations_is_refused(tmp_path, monkeypatch):
    stiff = Prism(1.0, 0.7, 0.01, 1.0, k_base=20.0, k_bar=200.0).potential()
    monkeypatch.setattr(type(stiff), "_compiled_on", lambda *_: None)
    with pytest.raises(EquilibriumError, match="too stiff"):
        stiff.to_c(tmp_path / "spring.c")
    assert list(tmp_path.iterdir()) == []
