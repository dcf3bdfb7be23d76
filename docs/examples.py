"""The code of written pages: run when the site is built, with what it prints and draws below it.

The blocks of a page run from its top to its end in one namespace, in an empty folder.  Results are
stored in `docs/_made/examples` until the page, or a source of the packages, changes.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import multiprocessing
import os
import re
import shutil
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from types import ModuleType

from figures import _stored
from tensegrity.check import replacing

BLOCK = re.compile(r"^```python\n(.*?)^```\n", re.DOTALL | re.MULTILINE)
MADE = Path("_made", "examples")
DOTS_PER_INCH = 130


def written(source):
    """{name: text} of the pages with code that are under version control."""
    paths = [*source.glob("*.md"), *source.glob("guide/*.md")]
    texts = {str(p.relative_to(source).with_suffix("")): p.read_text("utf-8") for p in paths}
    return {name: text for name, text in sorted(texts.items()) if BLOCK.search(text)}


def run(name, text, folder):
    """Run the blocks of a page from its top to its end, each as a user would.

    Parameters
    ----------
    name : str
        Of the page.
    text : str
        In Markdown.
    folder : Path
        Where pictures are written to, and the blocks write to.

    Returns
    -------
    list of (str, list of (str, str))
        For each block what it printed, and the titles and files of the figures that it left open
        and of the films that it wrote.

    Raises
    ------
    RuntimeError
        If a block fails; names page and block.
    """
    import matplotlib.pyplot as plt

    plt.switch_backend("Agg")
    page = sys.modules["page"] = ModuleType("page")  # where functions of a page are pickled from
    multiprocessing.set_start_method("fork", force=True)  # other processes do not have it
    results = []
    for number, block in enumerate(BLOCK.findall(text), 1):
        before = {path: path.stat().st_mtime_ns for path in folder.glob("*.gif")}
        with contextlib.redirect_stdout(io.StringIO()) as printed, contextlib.chdir(folder):
            try:
                exec(compile(block, f"{name}, block {number}", "exec"), page.__dict__)
            except BaseException as error:
                raise RuntimeError(f"{name}, block {number}: {error!r}") from error
        shown = []
        for figure in map(plt.figure, plt.get_fignums()):
            titles = [figure.get_suptitle(), *(axes.get_title() for axes in figure.axes)]
            file = f"{number}-{figure.number}.png"
            figure.savefig(folder / file, dpi=DOTS_PER_INCH, bbox_inches="tight")
            shown.append((" | ".join(filter(None, titles)), file))
        plt.close("all")
        shown += [
            (f"{path.stem.replace('_', ' ')}, in motion", path.name)
            for path in sorted(folder.glob("*.gif"))
            if before.get(path) != path.stat().st_mtime_ns
        ]
        results.append((printed.getvalue(), shown))
    return results


def store(name, text, of, made):
    """Run a page in a temporary folder and store its results, with the digest that they are of."""
    with tempfile.TemporaryDirectory() as folder:
        results = run(name, text, Path(folder))
        for _, file in (one for _, shown in results for one in shown):
            made.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(Path(folder, file), made / file)
    made.mkdir(parents=True, exist_ok=True)
    with replacing(made / "results.json") as new:
        new.write_text(json.dumps({"of": of, "results": results}))


def digest(text):
    """Of a page and of all sources that its results may depend on."""
    parts = text, _stored.everything(), _stored.digest(Path(__file__))
    return hashlib.sha256(" ".join(parts).encode()).hexdigest()


def stored(made):
    """The stored results of a page, or {}."""
    path = made / "results.json"
    return json.loads(path.read_text()) if path.is_file() else {}


def run_all(source):
    """Run the pages whose stored results are not of these sources, two at a time."""
    todo = {}
    for name, text in written(source).items():
        if stored(source / MADE / name).get("of") != (of := digest(text)):
            shutil.rmtree(source / MADE / name, ignore_errors=True)
            todo[name] = text, of, source / MADE / name
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, mp_context=fresh, max_tasks_per_child=1) as pool:
        for one in [pool.submit(store, name, *rest) for name, rest in todo.items()]:
            one.result()


def add_results(app, name, content):
    """Put below each block of a page, as Sphinx reads it, what it printed and drew."""
    if found := stored(Path(app.srcdir) / MADE / name):
        app.env.note_dependency(str(MADE / name / "results.json"))
        results = iter(found["results"])
        content[0] = BLOCK.sub(lambda block: block[0] + below(name, *next(results)), content[0])


def below(name, printed, shown):
    """The results of a block, as Markdown."""
    parts = [f"`````{{code-block}} text\n:class: output\n\n{printed}`````"] if printed else []
    for title, file in shown:
        title = re.sub(r"([*_<\[\]`|\\])", r"\\\1", title)
        parts.append(f"![{title}](/{(MADE / name / file).as_posix()})")
    return "".join(f"\n{part}\n" for part in parts)
