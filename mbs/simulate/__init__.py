"""Simulation: of a system by compiled code, of an FMU through an importer."""

from mbs.simulate.fmu import fmu
from mbs.simulate.run import run

__all__ = ["fmu", "run"]
