"""Cache of state equations on disk, shared between processes."""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi

from mbs.assembly import System
from mbs.files import read_sealed, write_sealed
from mbs.models.state.tree import FullState
from mbs.native.compiler import cache_dir


def cached_on_disk(system: System, laws: Any, derive: Callable[[], FullState]) -> FullState:
    """Return a state equation from the cache on disk, or derive and store it.

    An unreadable entry is derived again. Systems with user-defined Python code have no cache key
    and are not cached. MBS_KEEP_EQUATIONS=0 disables the cache.

    Args:
        system: open or closed system.
        laws: cache key of the laws.
        derive: callable that derives the state equation.
    """
    own = system.fingerprint()
    if own is None or os.environ.get("MBS_KEEP_EQUATIONS", "1") == "0":
        return derive()
    content = repr((own, laws, casadi.CasadiMeta.version(), _source_hash()))
    name = hashlib.sha256(content.encode()).hexdigest()
    file = cache_dir() / f"equations-{name}.pickle"
    with suppress(Exception):  # the file is missing or damaged
        found: FullState = pickle.loads(read_sealed(file))
        return found
    made = derive()
    with suppress(Exception):  # a full disk, or a Function that cannot be pickled
        write_sealed(pickle.dumps(replace(made, prepared={})), file)
    return made


@functools.cache
def _source_hash() -> str:
    """Return a hash of the Python files of this package, which derive the equations."""
    total = hashlib.sha256()
    for file in sorted(Path(__file__).parents[1].rglob("*.py")):
        total.update(file.read_bytes())
    return total.hexdigest()
