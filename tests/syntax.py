"""Syntax trees of the sources, read once in a process."""

import ast
from functools import cache


@cache
def tree(path):
    return ast.parse(path.read_text())
