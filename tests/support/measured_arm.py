"""An arm of three joints with known parameters, and records of its motion with noise."""

from __future__ import annotations

from functools import cache

import numpy as np

import mbs
from mbs.identification import Record, Samples, base_parameters, regressor, symbolic_parameters
from mbs.robots.rows import cuboid, frame, robot

RATE = 400.0
SPAN = 10.0
_FREQUENCY = 0.2
_HARMONICS = 4


@cache
def arm():
    """Shoulder about the vertical, two joints about parallel axes; friction and rotors in all."""
    frames = [frame(0, r=0.3), frame(1, alpha=-np.pi / 2, r=0.1), frame(2, d=0.5, r=-0.05)]
    own = {"Ia": 0.3, "Fv": 0.8, "Fs": 1.5, "Fs_width": 0.1}
    bodies = [
        cuboid(1, 6, (0.2, 0.2, 0.3), (0.01, 0.02, -0.1), **own),
        cuboid(2, 4, (0.6, 0.1, 0.12), (0.2, 0.03, 0.05), **own),
        cuboid(3, 2, (0.4, 0.08, 0.06), (0.15, -0.02, 0.04), **own),
    ]
    return robot("measured_arm", "illustrative", frames, bodies).assemble()


@cache
def equations():
    """Regressor, base parameters and their true values."""
    D = regressor(arm())
    base = base_parameters(arm(), columns=D.columns)
    full = np.array(mbs_values(D.columns))
    return D, base, base.matrix @ full


def mbs_values(columns):
    """(k,) the parameters of the arm as floats."""
    return [float(x) for x in symbolic_parameters(arm(), columns).elements()]


def motion(seed=0, rate=RATE):
    """Time, q, v, a of a sum of sines for each joint."""
    rng = np.random.default_rng((7, seed))
    time = np.arange(int(SPAN * rate)) / rate
    sine, cosine = rng.uniform(-0.35, 0.35, (2, _HARMONICS, 3))
    q, v, a = np.zeros((3, len(time), 3))
    for k in range(_HARMONICS):
        w = 2 * np.pi * _FREQUENCY * (k + 1)
        s, c = np.sin(w * time)[:, None], np.cos(w * time)[:, None]
        q += sine[k] * s + cosine[k] * c
        v += w * (sine[k] * c - cosine[k] * s)
        a -= w * w * (sine[k] * s + cosine[k] * c)
    return time, q, v, a


def true_efforts(q, v, a):
    """(n, 3) efforts of the inverse dynamic model [N m]."""
    idm = mbs.models.inverse_dynamics(arm())
    return np.array(idm.map(len(q))(q.T, v.T, a.T)).T


def noisy_samples(deviation, seed=0, rate=50.0):
    """Exact motion, and efforts with independent noise of these deviations [N m]."""
    time, q, v, a = motion(seed, rate)
    noise = np.random.default_rng((8, seed)).normal(size=q.shape) * deviation
    efforts = ("q1", "q2", "q3")
    return Samples(time, q, v, a, true_efforts(q, v, a) + noise, efforts, ("N.m",) * 3)


def noisy_record(position=1e-5, effort=0.2, seed=0):
    """A record whose positions [rad] and efforts [N m] have noise of these deviations."""
    time, q, v, a = motion(seed)
    rng = np.random.default_rng((9, seed))
    tau = true_efforts(q, v, a) + effort * rng.normal(size=q.shape)
    return Record.of(arm(), time, q + position * rng.normal(size=q.shape), tau)
