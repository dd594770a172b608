"""Simulation of a system by compiled code, of an FMU through FMPy, and of parameter sweeps."""

from mbs.simulate.fmu import fmu
from mbs.simulate.run import Simulator, run
from mbs.simulate.sweep import Sweep, sweep

__all__ = ["Simulator", "Sweep", "fmu", "run", "sweep"]
