"""Arguments of the export of models as C source."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import get_args

from casadi import Function

from mbs.assembly import System
from mbs.files import PathLike
from mbs.native.c_code import Real
from mbs.native.scalar_source import Target
from mbs.options import described, one_of

Model = Function | System
Functions = Model | Sequence[Model] | Mapping[str, Model]

_TARGETS: tuple[Target, ...] = get_args(Target)
_REALS: tuple[Real, ...] = get_args(Real)


@dataclass(frozen=True, kw_only=True)
class CLibraryOptions:
    """Options of a C library that its arguments and its internal settings share."""

    __slots__ = ()

    target: Target = field(
        default="hosted",
        metadata=described(
            '"hosted", or "bare" for systems without an operating system.',
            dict.fromkeys(_TARGETS, ""),
            check=one_of(_TARGETS),
            command="--bare",
            command_text="for microcontrollers: C99 without heap, files and global variables.",
        ),
    )
    real: Real = field(
        default="double",
        metadata=described(
            'type of numbers of a bare library: "double" or "float". In single precision, loops may'
            " be open by 1e-5 of the size of the mechanism, because positions round to 6e-8.",
            dict.fromkeys(_REALS, ""),
            check=one_of(_REALS),
            command="--float",
            command_text="single precision, with --bare.",
        ),
    )
    checked: bool = field(
        default=True,
        metadata=described(
            "whether calls are checked. If False, a call returns 0 for all inputs, also if the"
            " model is not valid there. Steps are always checked.",
            command="--checked",
            command_text="whether calls check their inputs and results.",
        ),
    )


@dataclass(frozen=True, slots=True)
class CLibraryArguments(CLibraryOptions):
    """Arguments of `mbs.export.c_library`."""

    functions: Functions = field(
        metadata=described(
            "models of one or several systems with distinct names, or dict from name in C to model."
            ' Systems too with target="bare".'
        )
    )
    folder: PathLike = field(
        metadata=described(
            "folder to write to. It is created if it does not exist. Files that mbs wrote are"
            " replaced."
        )
    )
