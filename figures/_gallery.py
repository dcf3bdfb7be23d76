"""Pages made of the pictures: one page per group, and `index.html` with all finished ones."""

import re
from html import escape
from inspect import cleandoc
from pathlib import Path

from derivations.argument import SOURCES
from figures import chosen, pictures
from figures._files import read_printed, write

PAGES = {"composite": "The composite claim", "limits": "Limits of the methods"}  # titles
FIRST = "start"  # group
STYLE = """
:root { color-scheme: light dark; }
body { font: 1rem/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
nav a { margin-right: .8rem; white-space: nowrap; } h2 { margin-top: 3rem; }
figure { margin: 2.5rem 0; } img { max-width: 100%; height: auto; background: #fff; }
.table { overflow-x: auto; } table { border-collapse: collapse; font-size: .85rem; }
th, td { text-align: left; padding: .15rem .7rem .15rem 0; border-bottom: 1px solid #8884; }
code { font-size: .9em; }
"""


def named(text):
    """Text in which the two sources have their names."""
    for short_name, name in SOURCES.items():
        text = text.replace(short_name, name)
    return text


def title(module):
    """The first line of a picture's docstring."""
    return named(module.__doc__.splitlines()[0].rstrip("."))


def words(module):
    """The paragraphs of a picture's docstring after the first line."""
    rest = named(cleandoc(module.__doc__).partition("\n")[2].strip())
    return [" ".join(part.split()) for part in re.split(r"\n\s*\n", rest) if part]


def shown(value):
    """A number with six digits, anything else as it is."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def short(cell):
    """A cell of a file as it is shown: a number with a fraction to six digits."""
    try:
        return cell if re.fullmatch(r"[-+]?\d*", cell) else f"{float(cell):.6g}"
    except ValueError:
        return cell


def write_page(group, rendered, folder):
    """One page of a group's sections, where all of them were just made; the file written."""
    described = [n for n, m in chosen([group]).items() if hasattr(m, "text")]
    if not described or not set(described) <= set(rendered):
        return []
    sections = [(folder / f"{name}.md").read_text() for name in described]
    path = folder / f"{group}.md"
    page = "\n".join([f"# {PAGES.get(group, group.capitalize())}\n", *sections])
    write(path, lambda beside: Path(beside).write_text(page))
    return [path]


def made(folder):
    """{group: {name: module}} of the pictures in an output folder, the introductory ones first."""
    found = {}
    for name, module in pictures().items():
        if (folder / module.GROUP / f"{name}.png").is_file():
            found.setdefault(module.GROUP, {})[name] = module
    return dict(sorted(found.items(), key=lambda group: group[0] != FIRST))


def _table(lines):
    """Lines {column: str} as HTML."""
    if not lines:
        return ""
    head = "".join(f"<th>{escape(key)}</th>" for key in lines[0])
    cells = ("".join(f"<td>{escape(short(v))}</td>" for v in line.values()) for line in lines)
    rows = "".join(f"<tr>{of_line}</tr>\n" for of_line in cells)
    return f'<div class="table"><table><tr>{head}</tr>\n{rows}</table></div>'


def _picture(name, module, folder):
    """One picture with its description, its printed lines, its numbers and its command."""
    place, head = f"{module.GROUP}/{name}", escape(title(module))
    parts = [f'<figure id="{name}"><h3>{head}</h3>']
    parts += [f"<p>{escape(part)}</p>" for part in words(module)]
    parts.append(f'<img src="{place}.png" alt="{head}" loading="lazy">')
    if (folder / f"{place}.gif").is_file():
        parts.append(f'<p><img src="{place}.gif" alt="{head}, in motion"></p>')
    numbers = ""
    if (data := folder / f"{place}.csv").is_file():
        parts.append(_table(read_printed(data)))
        numbers = f'<a href="{place}.csv">numbers</a> · '
    parts.append(f"<p>{numbers}<code>python -m figures {name}</code></p></figure>")
    return "\n".join(parts)


def write_index(folder):
    """`index.html` of all pictures that are in an output folder; the file written."""
    groups = made(folder)
    links = "".join(f'<a href="#{group}">{escape(group)}</a>' for group in groups)
    parts = [
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>Pictures</title>',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<link rel="icon" href="data:,"><style>{STYLE}</style></head><body>',
        "<h1>Pictures</h1>",
        "<p>Numbers stand in CSV files, one a line: table, column, row, value.</p>",
        f"<nav>{links}</nav>",
    ]
    for group, modules in groups.items():
        parts.append(f'<h2 id="{group}">{escape(group)}</h2>')
        parts += [_picture(name, module, folder) for name, module in modules.items()]
    path = folder / "index.html"
    page = "\n".join([*parts, "</body></html>\n"])
    write(path, lambda beside: Path(beside).write_text(page, encoding="utf-8"))
    return path
