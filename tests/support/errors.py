"""How far a simulated motion is from a reference."""

from __future__ import annotations

import numpy as np

THRESHOLD = 1e-3


def rms_error(values, reference):
    """The benchmark library's measure: rms of (y - yref) / max(|yref|, 1e-3) over all outputs.

    Source: Gonzalez et al. 2006.
    """
    y, reference = np.asarray(values), np.asarray(reference)
    assert y.shape == reference.shape
    return float(
        np.sqrt(np.mean(((y - reference) / np.maximum(np.abs(reference), THRESHOLD)) ** 2))
    )
