"""`python -m docs.live [FILE]` writes the page, by default to docs/live/output/index.html."""

from __future__ import annotations

import base64
import json
import sys
from argparse import ArgumentParser
from importlib.resources import files
from pathlib import Path

from docs.live import kernel, net
from docs.live.tables import tables
from tensegrity.check import replacing

FOLDER = Path(__file__).parent
OUTPUT = FOLDER / "output" / "index.html"
LARGEST = 400_000  # bytes


def page() -> str:
    """The page: one file with its style, programs, tables and compiled code in it."""
    given = tables() | {"method": kernel.METHOD.name, "net": net.tables()}
    data = json.dumps(given, separators=(",", ":"))
    code = [kernel.wasm(kernel.text()), kernel.wasm(kernel.net_text(net.laws()), "-DDIM=2")]
    codes = [base64.b64encode(one).decode() for one in code]
    parts = {
        "/*STYLE*/": (FOLDER / "page.css").read_text(),
        "/*MODEL*/": (FOLDER / "chain.js").read_text(),
        "/*VIEWER*/": files("tensegrity.viewer").joinpath("viewer.js").read_text(),
        "/*TABLES*/null": data.replace("</", "<\\/"),
        "/*CODE*/": codes[0],
        "/*NET*/": codes[1],
        "/*PAGE*/": "\n".join((FOLDER / name).read_text() for name in ("page.js", "net.js")),
    }
    text = (FOLDER / "page.html").read_text()
    for mark, part in parts.items():
        text = text.replace(mark, part, 1)
    if len(text.encode()) > LARGEST:
        raise ValueError(f"the page has {len(text.encode())} bytes, at most {LARGEST} are meant")
    return text


def main(arguments: list[str]) -> int:
    """Write the page; 1 where there is nothing to compile it with."""
    parser = ArgumentParser(prog="python -m docs.live", description=__doc__)
    parser.add_argument("file", nargs="?", type=Path, default=OUTPUT)
    path = parser.parse_args(arguments).file
    if kernel.missing():
        print(f"no page: {kernel.missing()}", file=sys.stderr)
        return 1
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as new:
        new.write_text(page(), encoding="utf-8")
    print(f"{path}: {path.stat().st_size} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
