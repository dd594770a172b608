"""Simulation of a system by compiled code, of an FMU through FMPy, and of parameter sweeps."""

from mbs.simulate._fmu import fmu
from mbs.simulate._sweep import Sweep, sweep
from mbs.simulate.simulator import Simulator, run

__all__ = ["Simulator", "Sweep", "fmu", "run", "sweep"]
