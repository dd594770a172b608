"""Grouping by rules: those of trees, then those of closed loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from casadi import SX

from mbs.assembly import System
from mbs.identification.base.grouping import Grouping, Terms, related, without_zeros
from mbs.identification.base.loops import (
    ClosedPostures,
    cut_relations,
    pair_relations,
)
from mbs.identification.base.rules import Key, tree_rules
from mbs.identification.base.samples import sampler
from mbs.identification.base.structure import Structure
from mbs.identification.base.turning import turning_relations
from mbs.identification.regressors.columns import Column


def grouped_by_rules(
    system: System,
    columns: Sequence[Column],
    postures: Sequence[ClosedPostures],
    structure: Structure,
) -> Grouping:
    """What the rules find.

    Args:
        system: open or closed.
        columns: the parameters.
        postures: that close the loops; none for an open system.
        structure: of its tree.
    """
    places = _places(columns)
    grouping = _by_tree(structure, Grouping.none(len(columns)), places)
    sampled = sampler(system)
    if not system.is_closed:
        return without_zeros(grouping, sampled)
    relations = [
        *cut_relations(system),
        *pair_relations(system, postures, base_moves=structure.base_moves),
        *turning_relations(system, postures, base_moves=structure.base_moves),
    ]
    for relation in relations:
        terms = _terms(relation, places)
        if terms is not None:
            grouping = related(grouping, terms, lambda k: columns[k].link, sampled)
    return without_zeros(grouping, sampled)


def _by_tree(structure: Structure, grouping: Grouping, places: Mapping[Key, int]) -> Grouping:
    for removal in tree_rules(structure):
        dropped, terms = places.get(removal.parameter), _terms(removal.effects, places)
        if dropped is not None and terms is not None and dropped in grouping.columns[dropped]:
            grouping = grouping.replaced(dropped, terms)
    return grouping


def _places(columns: Sequence[Column]) -> dict[Key, int]:
    """Numbers of the parameters of one link or joint."""
    return {(c.link - 1, c.kind): k for k, c in enumerate(columns) if not c.other}


def _terms(effects: Mapping[Key, SX], places: Mapping[Key, int]) -> Terms | None:
    """The combination in numbers of columns; None when a parameter of it is no column."""
    if any(key not in places for key in effects):
        return None
    return {places[key]: x for key, x in effects.items()}
