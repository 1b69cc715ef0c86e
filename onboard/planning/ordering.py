"""A level in ascending order of cost, as far as it is asked for: incremental quicksort.

A pass that keeps W of N nodes needs the order of the first few only. Pivots found on the way to the smallest element are
kept on a stack and serve the next ones, so that the first W take O(N + W log W). (R. Paredes, G. Navarro: Optimal
Incremental Sorting, ALENEX 2006.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from onboard.planning.clock import now_s
from onboard.planning.jit import kernel
from onboard.planning.tree import Tree

__all__ = ["OUT_OF_TIME", "next_in_order", "start_order"]

OUT_OF_TIME = -1
_CHECK_EVERY = 8192
_SMALL_RUN = 12


@kernel
def start_order(tree: Tree, count: int) -> int:
    """Prepare to draw ``count`` nodes from ``tree.order`` by ``tree.order_keys``; returns the depth of the stack."""
    tree.pivots[0] = count
    return 1


@kernel
def _before(key: float, node: int, other_key: float, other_node: int) -> bool:
    """A total order: by key, then by age, so that equal keys are no worst case and plans are repeatable."""
    return key < other_key or (key == other_key and node < other_node)


@kernel
def _sort_run(keys: NDArray[np.float64], nodes: NDArray[np.int32], begin: int, end: int) -> None:
    for i in range(begin + 1, end):
        key, node = keys[i], nodes[i]
        j = i
        while j > begin and _before(key, node, keys[j - 1], nodes[j - 1]):
            keys[j], nodes[j] = keys[j - 1], nodes[j - 1]
            j -= 1
        keys[j], nodes[j] = key, node


@kernel
def _partition(tree: Tree, begin: int, end: int, deadline_s: float) -> int:
    """Split a run at the median of three; returns where the pivot came to be."""
    keys, nodes = tree.order_keys, tree.order
    last, middle = end - 1, begin + (end - begin) // 2
    if _before(keys[middle], nodes[middle], keys[begin], nodes[begin]):
        keys[middle], keys[begin] = keys[begin], keys[middle]
        nodes[middle], nodes[begin] = nodes[begin], nodes[middle]
    if _before(keys[last], nodes[last], keys[begin], nodes[begin]):
        keys[last], keys[begin] = keys[begin], keys[last]
        nodes[last], nodes[begin] = nodes[begin], nodes[last]
    if _before(keys[middle], nodes[middle], keys[last], nodes[last]):
        keys[middle], keys[last] = keys[last], keys[middle]
        nodes[middle], nodes[last] = nodes[last], nodes[middle]
    key, node = keys[last], nodes[last]
    store = begin
    for i in range(begin, last):
        if (i - begin) % _CHECK_EVERY == _CHECK_EVERY - 1 and now_s(tree.timespec) > deadline_s:
            return OUT_OF_TIME
        if _before(keys[i], nodes[i], key, node):
            keys[i], keys[store] = keys[store], keys[i]
            nodes[i], nodes[store] = nodes[store], nodes[i]
            store += 1
    keys[last], keys[store] = keys[store], keys[last]
    nodes[last], nodes[store] = nodes[store], nodes[last]
    return store


@kernel
def next_in_order(tree: Tree, position: int, depth: int, deadline_s: float) -> int:
    """Bring the node that belongs at ``position`` there; all positions before it must have been drawn.

    Returns:
        The new depth of the stack, or ``OUT_OF_TIME``.
    """
    pivots = tree.pivots
    while pivots[depth - 1] != position:
        if depth + _SMALL_RUN >= pivots.shape[0]:  # forget the largest pivot; it will be found again
            for index in range(1, depth - 1):
                pivots[index] = pivots[index + 1]
            depth -= 1
        end = pivots[depth - 1]
        if end - position <= _SMALL_RUN:
            _sort_run(tree.order_keys, tree.order, position, end)
            for pivot in range(end - 1, position - 1, -1):
                pivots[depth] = pivot
                depth += 1
        else:
            pivot = _partition(tree, position, end, deadline_s)
            if pivot == OUT_OF_TIME:
                return OUT_OF_TIME
            pivots[depth] = pivot
            depth += 1
    return depth - 1
