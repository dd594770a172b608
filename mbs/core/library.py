"""The compiled run-time library, and the text of its C files."""

from __future__ import annotations

import functools
import importlib
import re
from collections.abc import Iterable
from typing import Any

from mbs.core.build import SOURCE, BuildError, build, is_current
from mbs.errors import CompilerError


@functools.cache
def core_library() -> Any:
    """Return the extension module `mbs.core._core`.

    A checkout compiles the library again if a C file was changed.

    Raises:
        CompilerError: the library is missing or older than its C files, and cannot be built.
    """
    if not is_current():
        try:
            build()
        except (BuildError, OSError) as error:
            raise CompilerError(str(error)) from error
        importlib.invalidate_caches()
    return importlib.import_module("mbs.core._core")


_INCLUDE = re.compile(r'^#include "(.+)"$', re.MULTILINE)


def core_files(names: Iterable[str]) -> dict[str, str]:
    """Return the texts of C files and headers of the run-time library, by name.

    Args:
        names: file names in `mbs/core/source`.

    Returns:
        dict from name to text: the named files, then further headers that they include.
    """
    waiting, texts = list(names), dict[str, str]()
    for name in waiting:  # the list grows
        if name not in texts:
            texts[name] = (SOURCE / name).read_text(encoding="utf-8")
            waiting += _INCLUDE.findall(texts[name])
    return texts
