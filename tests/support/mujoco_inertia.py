"""The inertia matrix of MuJoCo, by whichever arguments its version takes."""

import mujoco
import numpy as np


def full_inertia(model, data):
    """(nv, nv) the inertia matrix at the positions of the last mj_forward."""
    full = np.zeros((model.nv, model.nv))
    try:
        mujoco.mj_fullM(model, data, full)
    except TypeError:  # before MuJoCo 3.10
        mujoco.mj_fullM(model, full, data.qM)
    return full
