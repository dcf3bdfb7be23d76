"""Small versions of all pictures with their numbers, under version control.

The site is whole wherever it is built: what was drawn there is shown, and of all else what is kept
here.  Beside each picture stands the digest of the modules of `figures` that draw it, which a test
compares; its numbers are compared by drawing it again.
"""

import ast
import hashlib
import lzma
import re
from io import BytesIO
from pathlib import Path

from figures import _stored, chosen, pictures
from figures._files import write

HERE = Path(__file__).parent
SMALL = HERE.parent / "docs" / "pictures" / "small"
SHARED = ("_draw", "_files", "_gallery", "_stored")
COLOURS = 96
LONG = re.compile(r"-?\d+\.\d{9,}(?:e[-+]?\d+)?")  # numbers of more digits than are kept
LARGEST = 1_500_000  # bytes of a film
KINDS, COMPRESSED = ("png", "gif", "md", "csv"), {"csv": ".xz"}


def drawn_by(name):
    """Digest of the modules of `figures` that a picture is made of: comments and layout do not
    count, nor what all pictures share."""
    todo, seen = [name], {}
    while todo:
        one = todo.pop()
        if one not in seen and one not in SHARED:
            tree = ast.parse((HERE / f"{one}.py").read_text(encoding="utf-8"))
            seen[one] = repr(_stored.form(tree))
            found = [x for x in ast.walk(tree) if isinstance(x, ast.ImportFrom) and x.module]
            todo += [y.name for x in found if x.module == "figures" for y in x.names]
            todo += [x.module.split(".")[1] for x in found if x.module.startswith("figures.")]
    return hashlib.sha256("".join(seen[one] for one in sorted(seen)).encode()).hexdigest()[:16]


def keep(name, output, place=SMALL):
    """Keep what was drawn of a picture: fewer colours, numbers of 9 digits, no large film."""
    place.mkdir(parents=True, exist_ok=True)
    for kind in KINDS:
        path = output / pictures()[name].GROUP / f"{name}.{kind}"
        if path.is_file() and (kind != "gif" or path.stat().st_size < LARGEST):
            put(place / f"{name}.{kind}{COMPRESSED.get(kind, '')}", small(path))
    put(place / f"{name}.by", f"{drawn_by(name)}\n".encode())


def small(path):
    """Content of a file as it is kept."""
    if path.suffix == ".csv":
        text = LONG.sub(lambda found: f"{float(found[0]):.9g}", path.read_text(encoding="utf-8"))
        return lzma.compress(text.encode(), preset=9)
    if path.suffix != ".png":
        return path.read_bytes()
    from PIL import Image

    with Image.open(path) as image, BytesIO() as content:
        few = image.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
        few.save(content, "png", optimize=True)
        return content.getvalue()


def put(path, content):
    """Write a file where it is not the same, beside it first."""
    if not path.is_file() or path.read_bytes() != content:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(path, lambda new: Path(new).write_bytes(content))


def gather(output, folder, names=()):
    """Put pictures, by default all, in a folder, by groups: those that were drawn, else those that
    are kept."""
    for name, module in chosen(names).items():
        drawn = (output / module.GROUP / f"{name}.png").is_file()
        for kind in KINDS:
            target = folder / module.GROUP / f"{name}.{kind}"
            source = output / module.GROUP / target.name
            if not drawn:
                source = SMALL / f"{target.name}{COMPRESSED.get(kind, '')}"
            if not source.is_file():
                target.unlink(missing_ok=True)
                continue
            content = source.read_bytes()
            put(target, lzma.decompress(content) if source.suffix == ".xz" else content)
