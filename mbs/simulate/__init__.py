"""Simulation of a system by compiled code, of an FMU through FMPy, and of parameter sweeps."""

from mbs.simulate._fmu import fmu
from mbs.simulate._sweep import sweep
from mbs.simulate.simulator import Simulator, run
from mbs.simulate.sweep_results import Sweep

__all__ = ["Simulator", "Sweep", "fmu", "run", "sweep"]
