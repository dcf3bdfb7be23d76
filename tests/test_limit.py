"""The continued fold against folds located one by one."""

import math

import numpy as np
import pytest

from tensegrity import Prism, TensegrityError, equilibrium_path
from tensegrity.prisms.fold_curve import limit_load


@pytest.mark.parametrize(
    "stiffness", [(2.0, 20.0), (1e3, 1e4), (math.inf, 20.0), (20.0, math.inf), (1e8, 1e8)]
)
@pytest.mark.parametrize("ends", [(0.4, 1e-3), (1e-3, 0.4)])
def test_continued_fold_is_the_fold_of_every_prism_on_the_way(stiffness, ends):
    start, end = ends
    curve = limit_load(Prism(2.0, 0.6, start, 3.0, *stiffness), end)
    assert curve.prestrain[0] == pytest.approx(start, rel=1e-12)
    assert curve.prestrain[-1] == pytest.approx(end, rel=1e-12)
    for row in list(curve)[:: max(1, len(curve) // 6)]:
        prism = Prism(2.0, 0.6, float(row["prestrain"]), 3.0, *stiffness)
        fold = next(e for e in equilibrium_path(prism).events if e.kind == "fold")
        assert row["load"] == pytest.approx(fold.load, rel=1e-11)
        assert row["height"] == pytest.approx(fold.height, rel=1e-11)


def test_more_prestrain_raises_the_limit_load():
    curve = limit_load(Prism(1.0, 0.5, 1e-3, 1.0, 2.0, 20.0), 0.4)
    assert (np.diff(curve.load) > 0).all()


@pytest.mark.parametrize(
    ("prism", "prestrain", "message"),
    [
        (Prism(1.0, 0.25, 0.1, 1.0), 0.2, "needs elastic"),
        (Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0), 0.4, "must differ"),
    ],
)
def test_bad_input_is_refused(prism, prestrain, message):
    with pytest.raises(TensegrityError, match=message):
        limit_load(prism, prestrain)
