"""The loop on uniform prisms of the revision on the path: seconds and displacements."""

import hashlib
import time
from importlib import import_module

import numpy as np

from tensegrity import Chain, Prism
from tensegrity.scenes.dynamics import dynamics

try:
    METHODS = import_module("tensegrity.methods").METHODS  # before the package had rooms
except ImportError:
    METHODS = import_module("tensegrity.engine.methods").METHODS

SIZES = (100, 1_000, 100_000)
WORK, ROUNDS = 2_000_000, 7

for sites in SIZES:
    scene = Chain(Prism(1.0, 0.8, 0.02, 1.0).potential(), sites)
    u, v = 1e-3 * np.random.default_rng(0).standard_normal(sites), np.zeros(sites)
    bound, steps = dynamics(scene).bind(u, v, METHODS["verlet"], 0.02), WORK // sites
    bound.advance(steps)
    digest, seconds = hashlib.sha256(u.tobytes() + v.tobytes()).hexdigest(), []
    for _ in range(ROUNDS):
        began = time.process_time()
        bound.advance(steps)
        seconds.append(time.process_time() - began)
    print(sites, min(seconds), digest)
