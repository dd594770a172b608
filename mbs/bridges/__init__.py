"""Models where users of CasADi's optimal control tools need them: Opti, rockit, acados, JAX."""

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
