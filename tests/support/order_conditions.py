"""Order conditions of Rosenbrock methods, from rooted trees (Hairer and Wanner 1996, IV.7)."""

import functools

import numpy as np


@functools.cache
def trees(order):
    """Rooted trees of an order, each the sorted tuple of its branches."""
    return frozenset(_forests(order - 1, order - 1))


def _forests(order, largest):
    if order == 0:
        return {()}
    return {
        tuple(sorted((tree, *rest)))
        for size in range(1, min(order, largest) + 1)
        for tree in trees(size)
        for rest in _forests(order - size, size)
    }


def _order(tree):
    return 1 + sum(map(_order, tree))


def _density(tree):
    return _order(tree) * np.prod([_density(branch) for branch in tree])


def _weights(tree, alpha, gamma):
    matrix = alpha + gamma if len(tree) == 1 else alpha
    branches = [matrix @ _weights(branch, alpha, gamma) for branch in tree]
    return np.prod(branches, axis=0) if branches else np.ones(len(alpha))


def weight_errors(alpha, gamma, b, order, part=1.0):
    """What is left of the order conditions, one for each tree, at a part of the step."""
    return np.array(
        [
            abs(b @ _weights(tree, alpha, gamma) - part**order / _density(tree))
            for tree in trees(order)
        ]
    )
