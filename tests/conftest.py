import gc

import numpy as np
import pytest
import unchanged

import tensegrity

gc.set_threshold(100_000, 50, 100)  # trees of syntax and of SymPy are many objects in no cycle

EXTENDED = np.finfo(np.longdouble).nmant > 60


@pytest.fixture
def rng():
    return np.random.default_rng(20)


def pytest_configure(config):
    config.pluginmanager.register(unchanged)


def pytest_collection_modifyitems(items):
    for item in items:
        if item.get_closest_marker("needs_extended") and not EXTENDED:
            item.add_marker(pytest.mark.skip(reason="needs an extended long double"))


@pytest.fixture(scope="session")
def page(tmp_path_factory):
    """The live page, compiled."""
    from docs.live.__main__ import main

    path = tmp_path_factory.mktemp("live") / "index.html"
    assert main([str(path)]) == 0
    return path


@pytest.fixture(autouse=True)
def units_of_si():
    """Names of units are those of the process: a test that changes them leaves those of SI."""
    yield
    tensegrity.units()
