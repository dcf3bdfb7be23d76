"""Writes the derivations of known laws that come with the package: `make derived`.

They are what is derived for the scenes below in an empty cache: power laws, rigid and elastic
prisms, guides and packs, by default steps, tolerances and gradients; those of the demonstration.
"""

import json
import os
import tempfile


def scenes() -> None:
    """Calls whose first use should derive nothing."""
    import numpy as np

    from granular import Bead, Striker, energies, fcc_pack, hexagonal_pack, materials, y_guide
    from granular import chain as beads
    from granular.demo import checks, computed
    from tensegrity import (
        Chain,
        Network,
        Potential,
        PowerLaw,
        Prism,
        equilibrium_path,
        gradient,
        objective,
        sech2,
        simulate,
        solitary_wave,
        tent,
    )
    from tensegrity.prisms.fold_curve import limit_load

    checks(computed())
    steel, metal = Bead(4.76e-3, materials["steel"], mass=0.45e-3), materials["steel"]
    striker = Striker(steel, speed=0.5)
    rigid = Prism(1.0, 0.7, 0.1, 1.0)
    springs: list[Potential] = [
        PowerLaw(1.0, n, 0.01) for n in (1.5, 1.37, 0.5, 1.0, 2.0, 2.5, 3.0)
    ]
    springs += [rigid.potential(), Prism(1.0, 0.7, 0.1, 1.0, sides=4).potential()]
    elastic = [Prism(1.0, 0.7, 0.1, 1.0, 20.0, 100.0), Prism(1.0, 0.5, 0.4, 1.0, k_base=5.0),
               Prism(1.0, 0.5, 0.4, 1.0, k_bar=20.0)]  # fmt: skip
    springs += [one.potential() for one in elastic]
    for spring in springs:
        for order in range(4):
            spring.derivative(order, 0.0)
        chain = Chain(spring, sites=12)
        start = chain.at_rest({0: 1e-3})
        for how in ({"dt": 0.01}, {"dt": 0.01, "method": "rkn6"}, {"tol": 1e-6}, {"tol": 1e-3}):
            simulate(chain, start, 1.0, **how)
    for prism in (rigid, *elastic):
        equilibrium_path(prism)
    limit_load(Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0), 0.3)
    sech2(rigid.potential(), 1.5, 0.0)
    tent(rigid.potential(), 0.0)
    solitary_wave(rigid.potential(), speed_ratio=1.5)
    short = Chain(rigid.potential(), sites=8, ends=("free", "fixed"))
    peak = objective.peak(objective.load(bond=5))
    gradient(peak, short, short.at_rest({0: 0.01}), 1.0, dt=0.05, method="rkn6")
    row = beads([steel] * 8, striker=striker, end=metal)
    guide = y_guide(stem=5, branch=5, bead=steel, striker=striker)
    plane = hexagonal_pack(3, 4, bead=steel, striker=striker, floor=metal, sides=metal)
    space = fcc_pack(3, 2, bead=steel, striker=striker, floor=metal, sides=metal)
    for scene in (row, guide, plane, space):
        run = simulate(scene, scene.start(), 2e-5, tol=1e-5)
        energies(run)
        for method in ("verlet", "rkn6"):
            simulate(scene, scene.start(), 2e-5, method=method, dt=1e-7)
    for dim in (2, 3):
        places = np.eye(3)[:, :dim]
        net = Network(places, [(0, 1), (1, 2), (0, 2)], PowerLaw(1.0, 1.5))
        simulate(net, net.at_rest({0: (0.01,) * dim}), 1.0, tol=1e-6)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        from tensegrity.engine import disk_cache

        disk_cache.shipped = dict  # type: ignore[assignment]  # what was shipped before is derived again
        scenes()
        paths = sorted(disk_cache.cache_folder().glob("*.json"))
        disk_cache.write_shipped(
            [json.loads(one.read_bytes().partition(b"\n")[2]) for one in paths]
        )
        size = disk_cache.SHIPPED.stat().st_size / 1e6
        print(f"{len(paths)} values, {size:.2f} MB, {disk_cache.SHIPPED.name}")


if __name__ == "__main__":
    main()
