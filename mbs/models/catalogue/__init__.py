"""Every model by the name that menus, the command line and the documentation call it by."""

from mbs.errors import ModelError
from mbs.models.catalogue.dynamic import DYNAMIC
from mbs.models.catalogue.entry import Entry, Option
from mbs.models.catalogue.geometric import GEOMETRIC
from mbs.models.catalogue.kinematic import KINEMATIC
from mbs.text import did_you_mean

__all__ = ["Entry", "Option", "entries", "entry"]


def entries() -> tuple[Entry, ...]:
    """The models in the order of the menus."""
    return _ENTRIES


def entry(key: str) -> Entry:
    """The model of this short name.

    Raises:
        ModelError: there is none.
    """
    known = {one.key: one for one in _ENTRIES}
    if key not in known:
        raise ModelError(f"there is no model {key!r}; {did_you_mean(key, known)}")
    return known[key]


_ENTRIES: tuple[Entry, ...] = (*GEOMETRIC, *KINEMATIC, *DYNAMIC)
