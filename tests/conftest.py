import warnings

import numpy as np
import pytest

from tensegrity.engine import native


@pytest.fixture
def rng():
    return np.random.default_rng(20)


def has_compiler():
    """Whether kernels are compiled on this machine."""
    try:
        native.library("int tensegrity_probe;")
    except native.CompilerError:
        return False
    return True


COMPILED = has_compiler()
EXTENDED = COMPILED and np.finfo(np.longdouble).nmant > 60

if not COMPILED:
    warnings.filterwarnings("ignore", message="chains run on CasADi's virtual machine")


def pytest_collection_modifyitems(items):
    for item in items:
        if item.get_closest_marker("needs_compiler") and not COMPILED:
            item.add_marker(pytest.mark.skip(reason="needs a C compiler"))
        if item.get_closest_marker("needs_extended") and not EXTENDED:
            item.add_marker(pytest.mark.skip(reason="needs a compiler and an extended long double"))
