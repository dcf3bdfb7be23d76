"""Small versions of all pictures with their numbers, under version control.

The site is whole wherever it is built: what was drawn there is shown, and of all else what is kept
here.  Beside each picture stands the digest of the modules of `figures` that draw it, which a test
compares; its numbers are compared by drawing it again.
"""

import ast
import hashlib
import lzma
import sys
from io import BytesIO
from pathlib import Path

from figures import _stored, chosen, pictures
from figures._files import write

SMALL = Path(__file__).parent.parent / "docs" / "pictures" / "small"
COLOURS = 96
KINDS, COMPRESSED = ("png", "gif", "md", "csv"), {"csv": ".xz"}


def drawn_by(name):
    """Digest of the modules of `figures` that draw a picture: comments and layout do not count."""
    found = hashlib.sha256()
    for module in sorted(_stored.sources(pictures()[name].__name__)):
        if module.split(".")[0] == "figures":
            text = Path(sys.modules[module].__file__).read_text(encoding="utf-8")
            found.update(repr(_stored.form(ast.parse(text))).encode())
    return found.hexdigest()[:16]


def keep(name, output, place=SMALL):
    """Keep what was drawn of a picture: fewer colours, numbers compressed."""
    place.mkdir(parents=True, exist_ok=True)
    for kind in KINDS:
        path = output / pictures()[name].GROUP / f"{name}.{kind}"
        if path.is_file():
            put(place / f"{name}.{kind}{COMPRESSED.get(kind, '')}", small(path))
    put(place / f"{name}.by", f"{drawn_by(name)}\n".encode())


def small(path):
    """Content of a file as it is kept."""
    if path.suffix == ".csv":
        return lzma.compress(path.read_bytes(), preset=9)
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
