"""Structures that C takes: read from its text, filled by name."""

import ctypes
import re
from importlib.resources import files

import numpy as np
import pytest

from tensegrity.engine.native import library, structure

FOLDER = files("tensegrity.engine")
PYTHON = "".join(x.read_text() for x in FOLDER.iterdir() if x.name.endswith(".py"))
USED = sorted(set(re.findall(r'structure\("(.+?)", "(\w+)"\)', PYTHON)))
DECLARED = re.compile(r"typedef struct \{[^{}]*\} \w+;")


@pytest.mark.parametrize(("file", "name"), USED)
def test_fields_are_where_the_compiler_has_them(file, name):
    made, kinds = structure(file, name), ("long long integer", "double real", "void law")
    text = ["#include <stddef.h>", *(f"typedef {kind};" for kind in kinds)]
    text += DECLARED.findall(FOLDER.joinpath(file).read_text())
    names = [field for field, _ in made._fields_]
    offsets = ", ".join(f"offsetof({name}, {field})" for field in names)
    text.append(f"integer found[] = {{sizeof({name}), {offsets}}};")
    found = (ctypes.c_longlong * (1 + len(names))).in_dll(library("\n".join(text)), "found")
    assert list(found) == [ctypes.sizeof(made), *(getattr(made, x).offset for x in names)]


def test_every_field_is_given_by_its_name_and_no_other():
    looks, begins = structure("energies.c", "looks"), np.arange(2)
    made = looks(count=1, begins=begins, shares=None)
    assert (made.begins, made.shares, made.count) == (begins.ctypes.data, None, 1)
    for wrong in ({"count": 1, "begins": begins}, {**made.filled, "end": 1}):
        with pytest.raises(TypeError, match=r"shares|end"):
            looks(**wrong)
    with pytest.raises(AttributeError):
        made.fill(end=1)
