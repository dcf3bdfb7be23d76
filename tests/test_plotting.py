"""The space-time picture of a run."""

import matplotlib as mpl
import pytest
from scenes import prism_chain, smooth_blow

from tensegrity import Record, TensegrityError, simulate

mpl.use("Agg")


def test_plot_shows_energy_over_sites_and_time():
    chain = prism_chain(40)
    run = simulate(chain, smooth_blow(chain), 20.0)
    axes = run.plot()
    assert axes.get_xlabel() == "site"
    assert axes.get_ylabel() == "time [s]"
    image = axes.collections[0]
    assert image.get_array().shape == (len(run.t), 40)
    assert image.get_array().max() == chain.site_energy(run.u, run.v).max()


def test_plot_needs_all_sites():
    chain = prism_chain(40)
    run = simulate(chain, smooth_blow(chain), 1.0, record=Record(sites=[1, 2]))
    with pytest.raises(TensegrityError, match="2 of 40 sites"):
        run.plot()
