"""The code of the site's pages runs from the top of a page to its end, and asserts numbers."""

import ast
import re
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

DOCS = Path(__file__).parent.parent / "docs"
BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
PAGES = {
    str(path.relative_to(DOCS)): BLOCK.findall(path.read_text(encoding="utf-8"))
    for path in (
        DOCS / "index.md",
        *sorted((DOCS / "guide").glob("*.md")),
        DOCS / "extend.md",
        DOCS / "house.md",
    )
}
WITH_CODE = [name for name, blocks in PAGES.items() if blocks]


def test_each_job_has_a_page_with_code():
    jobs = {"curve", "wave", "impact", "beads", "protector", "structure", "gradients"}
    jobs |= {"potential", "method", "runs"}
    assert {f"guide/{job}.md" for job in jobs} <= set(WITH_CODE)
    assert len(PAGES["extend.md"]) == 4


@pytest.mark.parametrize("name", WITH_CODE)
def test_code_runs_from_top_to_end_as_it_stands(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plt.switch_backend("Agg")
    shared = {"__name__": "page"}
    for number, block in enumerate(PAGES[name]):
        exec(compile(block, f"{name}, block {number + 1}", "exec"), shared)
    plt.close("all")


@pytest.mark.parametrize("name", WITH_CODE)
def test_every_block_asserts_something_that_it_computed(name):
    for block in PAGES[name]:
        checked = [one.test for one in ast.walk(ast.parse(block)) if isinstance(one, ast.Assert)]
        assert any(
            {ast.Name, ast.Constant} <= {type(part) for part in ast.walk(test)} for test in checked
        )
