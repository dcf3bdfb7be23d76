"""The code of the site's pages runs from the top of a page to its end, and asserts numbers."""

import ast
import json
import os
from pathlib import Path
from types import SimpleNamespace

import examples
import pytest

from derivations.report import formula

pytestmark = pytest.mark.unchanged("figures", "docs", "README.md")

DOCS = Path(__file__).parent.parent / "docs"
PAGES = examples.written(DOCS)
PAGE = """# A page

```python
import matplotlib.pyplot as plt
x = 2
print("twice", x)
```

Text.

```python
from pathlib import Path

fig, ax = plt.subplots()
ax.set_title("A *straight* line")
Path("wave_on_chain.gif").write_bytes(b"GIF")
assert x == 2
```

```python
from concurrent.futures import ProcessPoolExecutor

def twice(x):
    return 2 * x

with ProcessPoolExecutor(1) as pool:
    assert list(pool.map(twice, [x])) == [4] and not plt.get_fignums()
```
"""


def test_each_job_has_a_page_with_code():
    jobs = {"curve", "wave", "impact", "beads", "protector", "structure", "gradients"}
    jobs |= {"potential", "method", "runs", "fits", "unit", "formula", "real-structure"}
    assert {f"guide/{job}" for job in jobs} | {"index", "extend", "house"} <= set(PAGES)
    assert len(examples.BLOCK.findall(PAGES["extend"])) == 11


@pytest.mark.parametrize("name", PAGES)
def test_code_runs_from_top_to_end_as_it_stands(name, tmp_path):
    examples.run(name, PAGES[name], tmp_path)


@pytest.mark.parametrize("name", PAGES)
def test_every_block_asserts_something_that_it_computed(name):
    for block in examples.BLOCK.findall(PAGES[name]):
        checked = [one.test for one in ast.walk(ast.parse(block)) if isinstance(one, ast.Assert)]
        assert any(
            {ast.Name, ast.Constant} <= {type(part) for part in ast.walk(test)} for test in checked
        )


def test_a_page_shows_what_its_blocks_print_draw_and_film(tmp_path):
    (tmp_path / "page.md").write_text(PAGE)
    (tmp_path / "without.md").write_text("# No code\n")
    examples.run_all(tmp_path)
    used, content = [], [PAGE]
    env = SimpleNamespace(note_dependency=used.append)
    examples.add_results(SimpleNamespace(srcdir=tmp_path, env=env), "page", content)
    _, first, second, third = content[0].split("```python\n")
    assert "`````{code-block} text\n:class: output\n\ntwice 2\n`````\n\nText." in first
    assert r"![A \*straight\* line](/_made/examples/page/2-1.png)" in second
    assert "![wave on chain, in motion](/_made/examples/page/wave_on_chain.gif)" in second
    assert third == PAGE.split("```python\n")[3]
    made = tmp_path / "_made/examples/page"
    assert {path.name for path in made.iterdir()} == {"2-1.png", "wave_on_chain.gif",
                                                      "results.json"}  # fmt: skip
    assert used == ["_made/examples/page/results.json"]


def test_a_page_runs_again_only_where_it_or_a_source_changed(tmp_path):
    page, results = tmp_path / "page.md", tmp_path / "_made/examples/page/results.json"
    page.write_text("```python\nimport os\n\nprint(os.getpid())\n```\n")
    examples.run_all(tmp_path)
    first = json.loads(results.read_text())
    assert first["results"][0][0] != f"{os.getpid()}\n"
    examples.run_all(tmp_path)
    assert json.loads(results.read_text()) == first
    page.write_text(page.read_text() + "\nMore.\n")
    examples.run_all(tmp_path)
    assert json.loads(results.read_text())["of"] != first["of"]
    results.write_text(json.dumps(first | {"of": "other sources"}))
    examples.run_all(tmp_path)
    assert json.loads(results.read_text())["of"] == examples.digest(page.read_text())


def test_a_block_that_fails_names_page_and_block(tmp_path):
    (tmp_path / "page.md").write_text(PAGE + "\n```python\nassert x > 2, 'too small'\n```\n")
    with pytest.raises(RuntimeError, match=r"page, block 4: AssertionError\('too small'\)"):
        examples.run_all(tmp_path)
    assert not (tmp_path / "_made/examples/page/results.json").exists()


def test_functions_of_a_page_can_be_pickled(tmp_path):
    block = "import pickle\n\n\ndef f():\n    return 7\n\n\nprint(pickle.loads(pickle.dumps(f))())"
    assert examples.run("page", f"```python\n{block}\n```\n", tmp_path) == [("7\n", [])]


def test_formulas_of_the_ledger_are_shown_as_they_were_derived():
    assert "<mi>sech</mi>" in formula("talk.sech2")
    assert "<math" in formula("talk.axial_stiffness")  # long: as printed, in agreement
    assert "<math" in formula("talk.H1_zero")  # a relation
    for name, why in (("no_such", "neither a derivation nor a formula"), ("mitigation", "a claim")):
        with pytest.raises(ValueError, match=f"'talk.{name}' is {why}"):
            formula(f"talk.{name}")
