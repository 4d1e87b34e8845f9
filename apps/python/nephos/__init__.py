# SPDX-License-Identifier: Apache-2.0
"""nephos from Python: scenes, steps, bits, statistics, clouds, densities and pictures as NumPy arrays; sweeps and fits.

    import nephos
    sim = nephos.Simulation(nephos.Scene("fair.toml").set("field.background.ext", 0.12), seed=7)
    sim.step(300)
    print(sim.statistics()["cloud_cover"], sim.hash())

Arrays have the order (z, y, x): z up, y north, x east. They are read-only. docs/research.md has more.
"""

from ._nephos import Density, Error, Scene, Simulation, set_threads, version
from ._studies import Sweep, fit, merge, sweep

__version__ = version()
__all__ = ["Density", "Error", "Scene", "Simulation", "Sweep", "fit", "merge", "set_threads", "sweep", "version"]

for _class in (Density, Scene, Simulation, Sweep, fit, merge, sweep):
    _class.__module__ = "nephos"
del _class
