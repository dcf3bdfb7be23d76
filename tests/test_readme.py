"""Every code block of the README runs as it stands, and asserts the numbers it tells of."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_block_runs_as_it_stands(number, tmp_path):
    answer = subprocess.run(
        [sys.executable, "-c", BLOCKS[number]],
        cwd=tmp_path,
        env={**__import__("os").environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert answer.returncode == 0, answer.stderr


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_block_asserts_a_number_that_it_computed(number):
    """A comparison with a number or, by NumPy, within a tolerance; of names, not of constants."""
    checked = [one.test for one in ast.walk(ast.parse(BLOCKS[number])) if type(one) is ast.Assert]
    assert any(
        {ast.Name, ast.Constant} <= {type(part) for part in ast.walk(test)}
        and any(isinstance(part, (ast.Compare, ast.Call)) for part in ast.walk(test))
        for test in checked
    )


def test_the_first_three_blocks_are_short():
    assert len(BLOCKS) >= 3
    for block in BLOCKS[:3]:
        assert len([line for line in block.splitlines() if line.strip()]) <= 10


def test_readme_opens_with_a_picture_and_two_commands():
    picture = re.search(r"!\[[^\]]+\]\(([^)]+)\)", TEXT)
    assert (ROOT / picture[1]).is_file()
    opening = TEXT[: TEXT.index("## ")]
    assert "make figures" in opening
    assert "make test" in opening
