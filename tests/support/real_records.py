"""Records of real robots, which are no part of the project; tests that need them skip."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

from mbs.identification import Record, motor_to_joint
from mbs.robots.rows import frame, robot

_ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("MBS_RECORDS", _ROOT.parent / "shared" / "data"))

_TX40_RATIOS = np.diag([32.0, 32, 45, -48, 45, 32])
_TX40_RATIOS[5, 4] = 32


def _archive(name):
    path = FOLDER / name
    if not path.exists():
        pytest.skip(f"the record {name} is not here; set MBS_RECORDS to its folder")
    return np.load(path)


@cache
def panda_record():
    """System and record of a Franka Emika Panda: 21 s at about 1 kHz, torques behind the gears.

    Source: Gaz et al. 2019.
    """
    numbers = _archive("panda_exciting_traj1.npz")
    system = catalogue_system("panda")
    return system, Record.of(system, *(numbers[k] for k in ("time", "q", "tau", "qd")))


@cache
def tx40_record():
    """System and record of a Staubli TX40: 9 s at 5 kHz, motor positions and currents."""
    numbers = _archive("tx40_5khz.npz")
    system = tx40()
    q, tau = motor_to_joint(_TX40_RATIOS, numbers["motor_position"], numbers["motor_current"])
    q = q + np.array([0, -np.pi / 2, np.pi / 2, 0, 0, 0])
    return system, Record.of(system, np.arange(len(q)) / 5000, q, tau)


def tx40():
    """Geometry of the Staubli TX40; its masses are illustrative."""
    half = np.pi / 2
    alpha, d = (0, -half, 0, half, -half, half), (0, 0, 0.225, 0, 0, 0)
    r = (0, 0, 0.035, 0.225, 0, 0)
    frames = [frame(k, alpha=alpha[k], d=d[k], r=r[k]) for k in range(6)]
    body = {"M": 1, "XX": 0.01, "YY": 0.01, "ZZ": 0.01, "Fs_width": 0.01}
    bodies = [{"frame": k + 1, **body} for k in range(6)]
    return robot("tx40", "Gautier, Janot & Vandanjon 2013", frames, bodies).assemble()
