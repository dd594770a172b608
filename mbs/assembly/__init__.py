"""Assembly of components into an immutable `System`: graph, tree, Khalil frames, tables."""

from mbs.assembly._symbolic import symbolic
from mbs.assembly.system import System
from mbs.assembly.tables import BodyRow, Closure, Coordinate, LinkRow, LoopRow
from mbs.assembly.tree import Link, Tree

__all__ = [
    "BodyRow",
    "Closure",
    "Coordinate",
    "Link",
    "LinkRow",
    "LoopRow",
    "System",
    "Tree",
    "symbolic",
]
