"""Pages generated from the figures, their printed tables, the ledger, and the public names.

They are written as Markdown when the site is built and are not under version control.  The numbers
of a figure are read from its files; a figure that was not made is named.
"""

from __future__ import annotations

import gzip
import hashlib
import importlib
import inspect
import json
import re
import shutil
import sys
import tomllib
from html import escape
from importlib.util import find_spec
from pathlib import Path

from claims import VERDICTS, changes, claims, numbers

from derivations import ledger, report
from figures import FIRST, claims_inputs, pictures
from figures._files import read_printed
from figures._gallery import named, short, title
from figures._gallery import words as _words
from tensegrity.check import replacing

ROOT = Path(__file__).parent.parent
OUTPUT = ROOT / "figures" / "output"
FORMULAS = tomllib.loads((Path(__file__).parent / "formulas.toml").read_text())["formulas"]
SEEN = tomllib.loads((Path(__file__).parent / "gallery.toml").read_text(encoding="utf-8"))
ROOMS = {  # page: (title, modules whose public names it holds, modules documented whole)
    "prisms": ("Prisms and their paths", ["tensegrity.prisms", "tensegrity.branches"],
               ["tensegrity.prisms.fold_curve", "tensegrity.prisms.stability"]),
    "springs": ("Springs", ["tensegrity.springs"], []),
    "scenes": ("Chains and networks", ["tensegrity.scenes"], []),
    "runs": ("Runs", ["tensegrity.runs"], []),
    "methods": ("Methods of integration", ["tensegrity.engine"], []),
    "waves": ("Solitary waves", ["tensegrity.waves", "tensegrity.orbits"],
              ["tensegrity.waves.asymptotics", "tensegrity.waves.curve",
               "tensegrity.waves.solitary"]),
    "structures": ("Structures", ["tensegrity.structures"], ["tensegrity.catalogue"]),
    "gradients": ("Gradients", ["tensegrity.gradients"], ["tensegrity.objective"]),
    "measure": ("Measures and films", ["tensegrity.measure", "tensegrity.animation"], []),
    "granular": ("Granular crystals", ["granular"],
                 ["granular.beads", "granular.observables", "granular.lammps",
                  "granular.design"]),
    "derivations": ("Derivations, as code", [],
                    ["derivations.argument", "derivations.ledger",
                     "derivations.report", "derivations.prism", "derivations.waves"]),
    "files": ("Files", [], ["tensegrity.files"]),
    "errors": ("Errors and types", ["tensegrity.errors"], ["tensegrity.typing"]),
}  # fmt: skip

JOINED = {"claims": "waves", "composite": "waves", "softening_limits": "waves",
          "gradients": "packs", "lens": "waves", "models": "response"}  # groups  # fmt: skip
TABLES = {"METHODS": "tensegrity.engine.methods"}  # of public tables, which have no module


def words(module):
    """The paragraphs of a picture's docstring, as Markdown that says what they say."""
    return [re.sub(r"([*_<\[\]`|])", r"\\\1", part) for part in _words(module)]


def write(path, *parts):
    """A page, touched only where it changes, so that a second build is short."""
    text = "\n\n".join(part for part in parts if part) + "\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        with replacing(path) as new:
            new.write_text(text, encoding="utf-8")


def raw(html):
    """HTML in a Markdown page."""
    return f"`````{{raw}} html\n{html}\n`````"


def cell(text):
    """A cell of a file; a number stays on one line."""
    text = short(text)
    alone = re.fullmatch(r"[-+0-9.e% ]+", text)
    return f'<span class="number">{text}</span>' if alone else escape(text)


def table(head, rows):
    """Rows of HTML cells as a table that scrolls by itself where a page is narrow."""
    top = "".join(f"<th>{cell}</th>" for cell in head)
    body = "\n".join("<tr>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>" for row in rows)
    return raw(
        f'<div class="wide" tabindex="0"><table><thead><tr>{top}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def copied(source, folder):
    """A file in a folder of the site, copied where it is newer; numbers compressed."""
    numbers = source.suffix == ".csv"
    target = folder / (f"{source.name}.gz" if numbers else source.name)
    folder.mkdir(parents=True, exist_ok=True)
    if not target.is_file() or target.stat().st_mtime < source.stat().st_mtime:
        if numbers:
            with replacing(target) as new:
                new.write_bytes(gzip.compress(source.read_bytes(), mtime=0))
        else:
            shutil.copy2(source, target)
    return target.name


def limits_text(path):
    """What a picture says in words below its own picture."""
    if not path.is_file():
        return ""
    return path.read_text(encoding="utf-8").partition(".png)\n\n")[2].strip()


def picture_page(name, module, folder):
    """One page of the gallery; whether its picture was made."""
    made = OUTPUT / module.GROUP
    image, film, data = (made / f"{name}.{kind}" for kind in ("png", "gif", "csv"))
    lines = read_printed(data) if data.is_file() else []
    copied(Path(module.__file__), folder / "code")
    head = title(module)
    write(
        folder / f"{name}.md",
        f"# {head}",
        *words(module),
        f"![{head}]({copied(image, folder)})" if image.is_file() else
        ":::{note}\nThis figure was not made before the site was built.\n:::",
        f"![{head}, in motion]({copied(film, folder)})" if film.is_file() else "",
        limits_text(made / f"{name}.md"),
        table(map(escape, lines[0]), [list(map(cell, line.values())) for line in lines])
        if lines else "",
        f"```sh\npython -m figures {name}\n```",
        f"{{download}}`All numbers <{copied(data, folder)}>`: a compressed file, one number per "
        "line, as table, column, row, value." if data.is_file() else "",
        raw("<details><summary>Code</summary>"),
        f"```{{literalinclude}} code/{name}.py\n:language: python\n```",
        raw("</details>"),
    )  # fmt: skip
    return image.is_file()


def what_to_see(name, module):
    """A sentence below the title of a picture, or ""."""
    first = re.split(r"(?<=\w{3}\.)\s", " ".join(_words(module)))[0]
    return SEEN.get(name, first)


def in_groups(found):
    """{group: names} of pictures {name: module}, what to see first in front, each once."""
    groups = {"": [name for name in FIRST if name in found]}
    for name, module in sorted(found.items(), key=lambda one: one[1].GROUP):
        if name not in FIRST:
            groups.setdefault(JOINED.get(module.GROUP, module.GROUP), []).append(name)
    return groups


def gallery(source):
    """A page for each figure, and an overview with the first ones in front.

    Returns the names of figures that were not made.
    """
    folder, found = source / "gallery", pictures()
    missing = [name for name, module in found.items() if not picture_page(name, module, folder)]
    parts = [
        "# Gallery",
        "Every figure is made by a module of `figures` from public calls only; its page contains "
        "a description, the printed table, the data and the code.",
    ]
    if missing:
        parts.append(
            f":::{{note}}\n{len(missing)} of {len(pictures())} figures were not made before this "
            "site was built: `make gallery` makes them all.\n:::"
        )
    for group, names in in_groups(found).items():
        cards = []
        for name in names:
            image = f'<img src="../_images/{name}.png" alt="" loading="lazy">'
            shown = '<span class="none">not made</span>' if name in missing else image
            head, seen = escape(title(found[name])), escape(what_to_see(name, found[name]))
            cards.append(f'<a href="{name}.html">{shown}<b>{head}</b><span>{seen}</span></a>')
        heading = group.replace("_", " ").capitalize() or "What to see first"
        parts += [f"## {heading}", raw(f'<div class="cards">{"".join(cards)}</div>')]
        parts.append("```{toctree}\n:hidden:\n\n" + "\n".join(names) + "\n```")
    write(folder / "index.md", *parts)
    return missing


def derived(source):
    """The derivations with the ledger, cached until their sources change."""
    digest = hashlib.sha256()
    for path in sorted((ROOT / "derivations").glob("*.py")):
        digest.update(path.read_bytes())
    kept = source / "_made" / "derivations.json"
    found = json.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else {}
    if found.get("of") != digest.hexdigest():
        from tqdm import tqdm

        sections = report.sections(progress=lambda x: tqdm(x, disable=None, file=sys.stderr))
        found = {"of": digest.hexdigest(), "sections": sections}
        write(kept, json.dumps(found))
    parts = [
        "# Derivations and ledger",
        "Every formula of the two sources is derived from energies and geometry by computer "
        "algebra and compared with its published form. `python -m derivations` prints this page; "
        "with `--check` it fails on a disagreement.",
    ]
    for key, head, body in found["sections"]:
        parts += [f"({key})=\n## {head}", raw(body)]
    write(source / "derivations.md", *parts)


def _verdict(kind):
    return f'<span class="verdict {kind}">{VERDICTS[kind]}</span>'


def _change(one):
    """How a number moves with its input."""
    what = f"{one['quantity']}, " if one["quantity"] else ""
    by = "; ".join(f"by {k}: {float(one[k]):+.1g}" for k in claims_inputs.CHANGES)
    return f'<p class="change">{what}relative change, {one["input"]} larger {by}</p>'


def _claim(claim):
    """One claim with its verdict, our numbers, the condition, and where both come from."""
    pieces = [
        f'<div class="claim {claim["verdict"]}" id="{claim["name"]}">',
        f"<blockquote>“{escape(claim['says'])}”</blockquote>",
        f'<p><span class="place">{claim["seed"].capitalize()}, {escape(claim["place"])}.</span> '
        f"{_verdict(claim['verdict'])}: {escape(claim['when'])}</p>",
    ]
    for number, value, error in numbers(claim, OUTPUT):
        what = escape(f"{number['row']}, {number['of']}" if "of" in number else number["row"])
        shown = f"<strong>{escape(short(value))}</strong>" if value else "figure not made"
        spread = f" (error {escape(short(error))})" if error else ""
        pieces.append(
            f"<p>{what}: {shown}{spread} · "
            f'<a href="gallery/{number["picture"]}.html">{number["picture"]}</a></p>'
        )
        moved = map(_change, changes(number, OUTPUT))
        pieces += [words for words in moved if words not in pieces]  # each once
    links = [
        f'<a href="derivations.html#{x}"><code>{x}</code></a>' for x in claim.get("ledger", ())
    ]
    if links:
        pieces.append(f"<p>Formula: {', '.join(links)}</p>")
    return "\n".join([*pieces, "</div>"])


def claim_page(source):
    """Every sentence of the sources that states a result."""
    everything = claims()
    counts = {kind: sum(c["verdict"] == kind for c in everything) for kind in VERDICTS}
    parts = [
        "# Claims",
        "The results stated by the two sources, each with the result found here: the talk "
        "*Wave Dynamics of Innovative Nonlinear Lattices* and the paper *Highly nonlinear pulse "
        "splitting and recombination in a two-dimensional granular network*. Numbers are read "
        "from the data files of the figures when this site is built; verdicts on formulas "
        "come from the ledger, below. Numbers of single runs are computed again with their input "
        "larger by 1e-6 and by 1 %, and stand with what this changes. What runs of touching beads "
        "show holds at any speed of the striker, because Hertz's law has no scale: 1 % more speed "
        "makes forces 1.2 % larger and times 0.2 % shorter.",
        raw("<p>" + " · ".join(f"{n} {_verdict(k)}" for k, n in counts.items() if n) + "</p>"),
    ]
    for head in dict.fromkeys(claim["about"] for claim in everything):
        parts.append(f"## {head}")
        parts += [raw(_claim(claim)) for claim in everything if claim["about"] == head]
    kinds = {"HOLDS": "holds", "CONVENTION": "under", "SLIP": "no", "NO_DATA": "open"}
    by_name = {x: c for c in everything for x in c.get("ledger", ())}
    rows = []
    for entry in ledger.entries():
        verdict = f'<span class="verdict {kinds[entry.verdict.name]}">{entry.verdict.value}</span>'
        if entry.verdict.name == "NO_DATA" and entry.name in by_name:
            decided = by_name[entry.name]
            said = "see" if decided["verdict"] == "open" else "decided by runs"
            verdict = f'<a href="#{decided["name"]}">{said}</a>: {_verdict(decided["verdict"])}'
        link = f'<a href="derivations.html#{entry.name}"><code>{entry.name}</code></a>'
        rows.append([link, escape(entry.place), verdict, report.prose(entry.note)])
    parts += ["## Formulas", table(["formula", "printed in", "verdict", "why"], rows)]
    write(source / "claims.md", *parts)


def limits(source):
    """The page on limits: as `python -m figures` wrote it, or as it is under version control."""
    made, shown = OUTPUT / "limits" / "limits.md", source / "pictures" / "limits.md"
    page = made if made.is_file() else shown
    text = page.read_text(encoding="utf-8")
    for name in re.findall(r"\]\(([\w.]+\.png)\)", text):
        copied(page.parent / name, source / "limits_pictures")
    write(source / "limits.md", re.sub(r"\]\(([\w.]+\.png)\)", r"](limits_pictures/\1)", text))


def public(modules):
    """Names offered by `tensegrity` and `granular` that are defined in these modules."""
    for package in ("tensegrity", "granular"):
        offered = importlib.import_module(package)
        for name in offered.__all__:
            defined = getattr(getattr(offered, name), "__module__", TABLES.get(name, package))
            if package == "granular" and not defined.startswith("granular"):
                continue
            if any(defined == m or defined.startswith(f"{m}.") for m in modules):
                yield package, name, getattr(offered, name)


def own(module):
    """What a module defines for use outside: its `__all__`, or all names that are not private."""
    names = getattr(module, "__all__", None) or [
        name
        for name, value in vars(module).items()
        if not name.startswith("_")
        and getattr(value, "__module__", None) == module.__name__
        and (inspect.isclass(value) or inspect.isfunction(value))
    ]
    return [(name, getattr(module, name)) for name in names]


def _documented(package, name, value):
    """The directive that documents a public object."""
    if inspect.isclass(value):
        return f".. autoclass:: {package}.{name}\n   :members:\n"
    if callable(value):
        return f".. autofunction:: {package}.{name}\n"
    return f".. autodata:: {package}.{name}\n   :no-value:\n"


def rooms():
    """ROOMS, and one more for what is in none of them."""
    packages = ["tensegrity", "granular"]
    known = [module for _, modules, _ in ROOMS.values() for module in modules]
    placed = {(package, name) for package, name, _ in public(known)}
    rest = [x for x in public(packages) if x[:2] not in placed and not inspect.ismodule(x[2])]
    others = sorted({value.__module__ for _, _, value in rest})
    return ROOMS | ({"others": ("Others", others, [])} if others else {})


def reference(source):
    """A page for each package with every public name; no object is described twice."""
    folder, everything = source / "reference", rooms()
    for page, (head, modules, whole) in everything.items():
        parts, seen = [f"# {head}"], set()
        directives = []
        for package, name, value in public(modules):
            if not inspect.ismodule(value):
                directives.append(_documented(package, name, value))
                seen.add(name)
        if directives:
            parts.append("```{eval-rst}\n" + "\n".join(directives) + "```")
        for dotted in filter(find_spec, whole):
            module = importlib.import_module(dotted)
            names = [(n, v) for n, v in own(module) if n not in seen]
            seen |= {n for n, _ in names}
            body = "\n".join(_documented(dotted, n, v) for n, v in names)
            opening = named(" ".join((module.__doc__ or "").split()))
            opening = re.sub(r"([*|<])", r"\\\1", opening)
            parts += [f"## {dotted}", opening, "```{eval-rst}\n" + body + "```" if body else ""]
        write(folder / f"{page}.md", *parts)
    write(
        folder / "index.md",
        "# Reference",
        "Every public name, with units, shapes, sign conventions and exceptions. Formulas are "
        "linked to their derivations.",
        "```{toctree}\n:maxdepth: 2\n\n" + "\n".join(everything) + "\n```",
    )


def link_formulas(app, what, name, obj, options, lines):
    """Names of ledger entries in a docstring lead to them; listed ones are added below it."""
    known = {entry.name for entry in ledger.entries()}
    text = named("\n".join(lines)).replace("|", r"\|")  # sizes, not substitutions
    text = re.sub(r"(?:(?<=\()|(?<=, ))\*(?=[a-z])(?![\w ]*\*)", r"\\*", text)  # a shape's
    for entry in sorted(set(re.findall(r"\b(?:talk|paper|ours)\.\w+", text)) & known):
        text = re.sub(rf"`*\b{re.escape(entry)}\b`*", _link(entry), text)
    short_name = name.removeprefix("tensegrity.")
    if short_name in FORMULAS:
        links = ", ".join(_link(entry) for entry in FORMULAS[short_name])
        text += f"\n\n.. rubric:: Derived\n\n{links}\n"
    lines[:] = text.splitlines()


def _link(entry):
    return f"`{entry} <../derivations.html#{entry}>`__"


LIVE = ROOT / "docs" / "live" / "output" / "index.html"  # made by `python -m docs.live`


def copy_live(out):
    """Put the live chain in place of the page that tells how to make it."""
    if LIVE.is_file():
        shutil.copy2(LIVE, out / "live.html")


def make(source):
    """All pages that are made."""
    missing = gallery(source)
    derived(source)
    claim_page(source)
    limits(source)
    reference(source)
    if missing:
        print(f"pictures not made ({len(missing)}): {', '.join(missing)}")
