"""Every code block of the README runs as it stands, and asserts the numbers it tells of."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from figures import wave_collision

pytestmark = pytest.mark.unchanged("README.md", "docs")

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text()
FOUND = re.findall(r"```python\n(.*?)```\n\n    ([^\n]*)\n", TEXT, re.DOTALL)
BLOCKS = [block for block, _ in FOUND]
MOST_WORDS, MOST_LINES = 1200, 10


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_block_runs_as_it_stands_and_prints_the_line_below_it(number, tmp_path):
    answer = subprocess.run(
        [sys.executable, "-c", BLOCKS[number]],
        cwd=tmp_path,
        env={**__import__("os").environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.strip() == FOUND[number][1]


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_block_asserts_a_number_that_it_computed(number):
    """A comparison with a number or, by NumPy, within a tolerance; of names, not of constants."""
    checked = [one.test for one in ast.walk(ast.parse(BLOCKS[number])) if type(one) is ast.Assert]
    assert any(
        {ast.Name, ast.Constant} <= {type(part) for part in ast.walk(test)}
        and any(isinstance(part, (ast.Compare, ast.Call)) for part in ast.walk(test))
        for test in checked
    )


def test_the_film_is_that_of_the_first_example():
    made = {}
    exec(BLOCKS[0].replace('animate(run, "waves.gif")\n', ""), made)
    np.testing.assert_array_equal(made["run"].u, wave_collision.filmed().u)


def test_there_are_a_first_example_and_five_jobs_each_of_few_lines():
    assert len(BLOCKS) == TEXT.count("```python") == 1 + 5
    assert len(re.findall(r"^### .+\n\n<img src=.+>\n\n\w", TEXT, re.MULTILINE)) == 5
    for block in BLOCKS:
        assert len([line for line in block.splitlines() if line.strip()]) <= MOST_LINES


def test_readme_is_short():
    assert len(TEXT.split()) <= MOST_WORDS


def test_readme_opens_with_a_prism_a_wave_and_commands():
    opening = TEXT[: TEXT.index("## ")]
    assert "docs/pictures/prism_drawing.png" in opening
    assert re.search(r"!\[[^\]]+\]\(docs/pictures/wave_collision.gif\)", opening)
    for command in ("pip install .", "make figures", "make test"):
        assert command in opening


def test_links_and_pictures_of_the_readme_are_there():
    links = re.findall(r"\]\(([^)]+)\)", TEXT) + re.findall(r'src="([^"]+)"', TEXT)
    assert len(links) >= 15
    assert [link for link in links if not (ROOT / link).is_file()] == []
    assert TEXT.count("<img ") == len(re.findall(r'<img [^>]*alt="[^"]+"', TEXT))
