"""Interfaces of models to optimal control tools of CasADi (Opti, rockit, acados) and to JAX."""

from mbs.bridges._collocation import collocation, constraint_residuals
from mbs.bridges._multiple_shooting import multiple_shooting
from mbs.bridges._rockit_stage import RockitStage, rockit_stage
from mbs.bridges._step import step
from mbs.bridges.acados_model import acados_fields
from mbs.bridges.jax_call import jax_function
from mbs.bridges.opti import Grid, Transcription
from mbs.deprecation import moved

__getattr__ = moved(__name__, {"invariants": "mbs.bridges.constraint_residuals"})

__all__ = [
    "Grid",
    "RockitStage",
    "Transcription",
    "acados_fields",
    "collocation",
    "constraint_residuals",
    "jax_function",
    "multiple_shooting",
    "rockit_stage",
    "step",
]
