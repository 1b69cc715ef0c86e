"""A level in ascending order, as far as it is asked for: incremental quicksort.

A pass that keeps W of N nodes needs the order of the first few only. Pivots found on the way to the smallest element
are kept on a stack and serve the next ones, so that the first W take O(N + W log W). (R. Paredes, G. Navarro: Optimal
Incremental Sorting, ALENEX 2006.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from onboard.planning.clock import Deadline, is_past
from onboard.planning.jit import inlined_kernel, kernel
from onboard.planning.tree import Order

__all__ = ["next_in_order", "start_order"]

_CHECK_EVERY = 8192
_SMALL_RUN = 12
_DEPTH = 127  # where the stack's depth is kept


@inlined_kernel
def start_order(order: Order, count: int) -> None:
    """Prepare to draw the first ``count`` nodes of ``order`` by their keys."""
    order.pivots[0] = count
    order.pivots[_DEPTH] = 1


@inlined_kernel
def _before(key: float, node: int, other_key: float, other_node: int) -> bool:
    """A total order: by key, then by age, so that equal keys are no worst case and plans are repeatable."""
    return key < other_key or (key == other_key and node < other_node)


@inlined_kernel
def _sort_run(keys: NDArray[np.float64], nodes: NDArray[np.int32], begin: int, end: int) -> None:
    for i in range(begin + 1, end):
        key, node = keys[i], nodes[i]
        j = i
        while j > begin and _before(key, node, keys[j - 1], nodes[j - 1]):
            keys[j], nodes[j] = keys[j - 1], nodes[j - 1]
            j -= 1
        keys[j], nodes[j] = key, node


@inlined_kernel
def _order_pair(keys: NDArray[np.float64], nodes: NDArray[np.int32], first: int, second: int) -> None:
    if _before(keys[second], nodes[second], keys[first], nodes[first]):
        keys[second], keys[first] = keys[first], keys[second]
        nodes[second], nodes[first] = nodes[first], nodes[second]


@kernel
def _partition(order: Order, begin: int, end: int, deadline: Deadline) -> int:
    """Split a run at the median of three; returns where the pivot came to be, −1 when out of time."""
    keys, nodes = order.keys, order.nodes
    last, middle = end - 1, begin + (end - begin) // 2
    _order_pair(keys, nodes, begin, middle)
    _order_pair(keys, nodes, begin, last)
    _order_pair(keys, nodes, last, middle)
    key, node = keys[last], nodes[last]
    store = begin
    for i in range(begin, last):
        if (i - begin) % _CHECK_EVERY == _CHECK_EVERY - 1 and is_past(deadline, order.timespec):
            return -1
        # Swapped always, counted only if smaller: no branch that the processor could mispredict.
        own_key, own_node = keys[i], nodes[i]
        keys[i], nodes[i] = keys[store], nodes[store]
        keys[store], nodes[store] = own_key, own_node
        store += (own_key < key) | ((own_key == key) & (own_node < node))
    keys[last], keys[store] = keys[store], keys[last]
    nodes[last], nodes[store] = nodes[store], nodes[last]
    return store


@kernel
def next_in_order(order: Order, position: int, deadline: Deadline) -> int:
    """The node that belongs at ``position``; all positions before it must have been drawn. −1 when out of time."""
    pivots = order.pivots
    depth = pivots[_DEPTH]
    while pivots[depth - 1] != position:
        if depth + _SMALL_RUN >= _DEPTH:  # forget the largest pivot; it will be found again
            for index in range(1, depth - 1):
                pivots[index] = pivots[index + 1]
            depth -= 1
        end = pivots[depth - 1]
        if end - position <= _SMALL_RUN:
            _sort_run(order.keys, order.nodes, position, end)
            for pivot in range(end - 1, position - 1, -1):
                pivots[depth] = pivot
                depth += 1
        else:
            pivot = _partition(order, position, end, deadline)
            if pivot < 0:
                return -1
            pivots[depth] = pivot
            depth += 1
    pivots[_DEPTH] = depth - 1
    return int(order.nodes[position])
