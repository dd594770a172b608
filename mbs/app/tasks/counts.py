"""Operations of many models, before and after the optimizer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from mbs.app.tasks.equations import EVERY_PASS, entries, entry, parsed_options
from mbs.assembly import System
from mbs.errors import MbsError
from mbs.operations import Count, count, simplify
from mbs.progress import progress

_NO_OPTIONS: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class CountRow:
    """The operations of a model.

    Attributes:
        key: of the model.
        title: of the model.
        before: as its recursion made it; None where the mechanism does not have it.
        after: after the optimizer; None likewise.
        reason: why there is none, "" where there is one.
    """

    key: str
    title: str
    before: Count | None
    after: Count | None
    reason: str


def counts(
    system: System,
    keys: Sequence[str] = (),
    passes: Sequence[str] = EVERY_PASS,
    options: Mapping[str, str] = _NO_OPTIONS,
) -> tuple[CountRow, ...]:
    """The operations of models.

    Args:
        system: the mechanism.
        keys: of the models; every one that is a Function when left out.
        passes: names of the passes of the optimizer.
        options: texts of options of all these models, as `parsed_options` takes them; the others
            at their defaults.

    Raises:
        ModelError: there is no such model, option or pass.
    """
    chosen = [entry(key) for key in keys] or [one for one in entries() if one.function is not None]
    rows = list[CountRow]()
    with progress(f"Counting operations of {system.name}", 0, len(chosen)) as reached:
        for number, one in enumerate(chosen):
            rows.append(_row(system, one.key, passes, options))
            reached(number + 1)
    return tuple(rows)


def _row(system: System, key: str, passes: Sequence[str], options: Mapping[str, str]) -> CountRow:
    one = entry(key)
    reason = one.refusal(system)
    if not reason and not one.has_function(system):
        reason = f"{one.title}: {system.name} has it as text or postures only"
    if reason:
        return CountRow(key, one.title, None, None, reason)
    given = parsed_options(system, one, options)
    try:
        model = one.build(system, **given)
    except MbsError as error:
        return CountRow(key, one.title, None, None, str(error))
    final = simplify(model, passes) if passes else model
    return CountRow(key, one.title, count(model), count(final), "")
