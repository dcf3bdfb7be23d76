"""The same job by several models: values, what simpler ones are off by, and which suffices."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import tensegrity as ts
from tensegrity import Chain, PowerLaw, Prism, TensegrityError, compare_models, prism_models

PRISM = Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0)
MASS, SPEED, COUNT = 3.0, 0.02, 3


def nearest(column, phase, frequency):
    found = ts.bands(column, [[phase]]).frequencies[0]
    return found[np.abs(found - frequency).argmin()]


def of_waves(units):
    """Frequency of the axial wave of so many units by the chain, by plates and by all nodes."""
    q = 2 * np.pi / units
    chain = float(ts.dispersion(PRISM.potential(), MASS, [q])[0, 0])
    plates = PRISM.column(plates=(MASS, PRISM.circumradius), periodic=True)
    nodes = PRISM.column(periodic=True)
    return compare_models({
        "chain": lambda: chain, "plates": lambda: nearest(plates, plates.nodes * q, chain),
        "nodes": lambda: nearest(nodes, nodes.nodes // 3 * q, chain),
    })  # fmt: skip


def test_the_chain_of_columns_is_off_by_one_percent_at_41_prisms_a_wave():
    found = of_waves(41)
    assert found["chain"].error == pytest.approx(0.01, rel=0.02)
    assert found["plates"].error < 5e-4
    assert [found.simplest(x).model for x in (0.02, 1e-3, 1e-6)] == ["chain", "plates", "nodes"]
    longer = of_waves(82)
    assert found["chain"].error / longer["chain"].error == pytest.approx(4, rel=0.02)


@pytest.fixture(scope="module")
def struck():
    models = prism_models(PRISM, COUNT, SPEED, MASS, bars=0.3)
    return models, compare_models(models, lambda run: run.v[:, 1].max(), 4.0, tol=1e-6)


def test_all_models_of_a_column_are_given_the_same_momentum(struck):
    for name, model in struck[0].items():
        momentum = np.ravel(model.scene.momentum(model.state))
        along = momentum[2] if len(momentum) == 3 else momentum[0]
        assert along == pytest.approx(MASS * SPEED, rel=1e-12), name


def test_views_of_all_models_are_runs_of_the_chain(struck):
    for name, model in struck[0].items():
        run = ts.simulate(model.scene, model.state, 0.5, tol=1e-4)
        seen = model.view(run) if model.view else run
        assert seen.u.shape == (len(run.t), COUNT + 1), name
        assert seen.v[0] == pytest.approx([SPEED, 0, 0, 0], abs=1e-15), name


def test_models_of_a_column_differ_as_little_as_what_they_leave_out(struck):
    found = struck[1]
    assert [row.model for row in found.rows] == [
        "rigid spring", "polynomial", "elastic spring", "plates", "nodes", "bars with mass",
    ]  # fmt: skip
    assert found["polynomial"].value == pytest.approx(found["elastic spring"].value, rel=1e-5)
    assert found["rigid spring"].value != pytest.approx(found["elastic spring"].value, rel=1e-3)
    assert found["plates"].error < found["elastic spring"].error
    assert max(row.resolved for row in found.rows) < 1e-3
    assert found["nodes"].evaluations > 3 * found["elastic spring"].evaluations


def test_what_fails_is_named_and_the_others_are_compared():
    chain = Chain(PowerLaw(1.0, 1.5), 3)

    def fails():
        raise TensegrityError("no such model")

    models = {"bad": fails, "odd": lambda: [1.0, 2.0],
              "beads": (chain, chain.at_rest({0: 1.0}))}  # fmt: skip
    found = compare_models(models, lambda run: run.final.v[-1], 3.0)
    assert [row.model for row in found.rows] == ["beads"]
    assert found.failed["bad"] == "no such model"
    assert "shape (2,)" in found.failed["odd"]
    assert "failed: bad" in str(found)
    with pytest.raises(TensegrityError, match="reference bad: no such model"):
        compare_models({"one": lambda: 1.0, "bad": fails})


def test_an_interrupt_keeps_the_models_that_were_run():
    def interrupts():
        raise KeyboardInterrupt

    found = compare_models({"one": lambda: 1.0, "two": lambda: 2.0, "three": interrupts})
    assert found.reference == "two"
    assert found["one"].error == 0.5
    assert found.failed == {"three": "interrupted"}


def test_table_and_picture_have_each_model():
    found = compare_models({"rough": lambda: 0.9, "fine": lambda: 1.0})
    assert found.to_dataframe().error.tolist() == pytest.approx([0.1, 0.0])
    ax = found.plot()
    assert [text.get_text() for text in ax.get_yticklabels()] == ["rough", "fine"]
    assert ax.get_ylim()[0] > ax.get_ylim()[1]  # the simplest above
    plt.close("all")
    with pytest.raises(TensegrityError, match="model 'best' is not one of rough, fine"):
        found["best"]


CHAIN = Chain(PowerLaw(1.0, 1.5), 3)


@pytest.mark.parametrize(
    ("models", "given", "message"),
    [
        ({}, {}, "dict of models"),
        ({"a": 1.0}, {}, "model a"),
        ({"a": (CHAIN, CHAIN.at_rest())}, {}, "give a quantity and t_end"),
        ({"a": lambda: 1.0}, {"reference": "b"}, "reference 'b' is not one of a"),
        ({"a": lambda: np.nan}, {}, "reference a"),
    ],
)
def test_wrong_models_are_refused_by_name(models, given, message):
    with pytest.raises(TensegrityError, match=message):
        compare_models(models, **given)


def test_rigid_prisms_have_no_column():
    with pytest.raises(TensegrityError, match="must be finite"):
        prism_models(Prism(1.0, 0.7, 0.1, 1.0), 3, 0.01)
