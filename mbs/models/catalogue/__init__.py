"""Catalogue of all models by the short names of menus, command line and documentation."""

from mbs.errors import ModelError
from mbs.models.catalogue.dynamic import DYNAMIC
from mbs.models.catalogue.entry import Entry, Option
from mbs.models.catalogue.geometric import GEOMETRIC
from mbs.models.catalogue.kinematic import KINEMATIC
from mbs.text import did_you_mean

__all__ = ["Entry", "Option", "entries", "entry"]


def entries() -> tuple[Entry, ...]:
    """Return all models in the order of the menus."""
    return _ENTRIES


def entry(key: str) -> Entry:
    """Return the model with a short name.

    Raises:
        ModelError: the name is unknown.
    """
    known = {one.key: one for one in _ENTRIES}
    if key not in known:
        raise ModelError(f"there is no model {key!r}; {did_you_mean(key, known)}")
    return known[key]


_ENTRIES: tuple[Entry, ...] = (*GEOMETRIC, *KINEMATIC, *DYNAMIC)
