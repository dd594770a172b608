"""Which calculated values of an FMU depend on which states, inputs, parameters and on time."""

import casadi

from mbs.export.fmu.description import FmuModel

_T, _X, _Z, _U, _P = range(5)  # arguments of rhs


def dependencies(model: FmuModel) -> list[tuple[int, list[int]]]:
    """What each derivative and each output depends on, through the closure of loops too.

    Args:
        model: what the FMU computes.

    Returns:
        value reference of the unknown, and of the states, inputs and parameters that it needs,
        in increasing order; last that of time, the number of entries.
    """
    places = {_X: model.first("state"), _U: model.first("input"), _P: model.first("parameter")}
    places[_T] = len(model.entries)
    through = _through_loops(model)
    answer = []
    for output, first in ((0, model.first("derivative")), (1, model.first("output"))):
        patterns = {k: _rows(model.rhs.jac_sparsity(output, k)) for k in (*places, _Z)}
        for row in range(model.rhs.numel_out(output)):
            known = {places[k] + c for k in places for c in patterns[k].get(row, ())}
            if patterns[_Z].get(row):
                known |= through
            answer.append((first + row, sorted(known)))
    return answer


def _through_loops(model: FmuModel) -> set[int]:
    """States and parameters that move any dependent coordinate: all of z counts as one."""
    if model.closure is None:
        return set()
    found = set()
    for k, first in ((0, model.first("state")), (2, model.first("parameter"))):
        for columns in _rows(model.closure.jac_sparsity(0, k)).values():
            found |= {first + c for c in columns}
    return found


def _rows(pattern: casadi.Sparsity) -> dict[int, list[int]]:
    rows: dict[int, list[int]] = {}
    for row, column in zip(*pattern.get_triplet(), strict=True):
        rows.setdefault(row, []).append(column)
    return rows
