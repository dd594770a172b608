"""Interfaces of models to optimal control tools of CasADi (Opti, rockit, acados) and to JAX."""

from mbs.bridges.acados_model import acados_fields
from mbs.bridges.collocation import collocation, invariants
from mbs.bridges.jax_call import jax_function
from mbs.bridges.multiple_shooting import multiple_shooting
from mbs.bridges.opti import Grid, Transcription
from mbs.bridges.rockit_stage import RockitStage, rockit_stage
from mbs.bridges.step import step

__all__ = [
    "Grid",
    "RockitStage",
    "Transcription",
    "acados_fields",
    "collocation",
    "invariants",
    "jax_function",
    "multiple_shooting",
    "rockit_stage",
    "step",
]
