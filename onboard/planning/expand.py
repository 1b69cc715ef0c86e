"""The successors of a node (Algorithm 2, lines 2–7), each paying only for the blocks it sees.

Prediction, the teammates' information and ``log det`` of both are the same for all children of a node and are computed
once. A child's cost then needs ``det(I + P·M)`` of the blocks that it sees, and its covariance is not computed until it
is opened.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from onboard.planning.blocks import FOUR, TWO, add_information, log_determinant, predict
from onboard.planning.feasibility import arc_is_clear, is_far_from_all, keeps_separation, violation_m
from onboard.planning.jit import kernel
from onboard.planning.looks import is_seen, look_weights
from onboard.planning.packing import PackedProblem
from onboard.planning.tree import Tree

__all__ = ["PENALTY_PER_M", "block_offset", "expand", "open_node", "predict_row"]

PENALTY_PER_M = 1e5
"""What a metre of violation adds to J at each step, so that a robot outside its bounds goes back in first."""

_LARGE = 1e100


@kernel
def block_offset(problem: PackedProblem, block: int) -> int:
    """Where a block begins in a packed row."""
    return FOUR * block if block < problem.n4 else FOUR * problem.n4 + TWO * (block - problem.n4)


@kernel
def predict_row(problem: PackedProblem, tree: Tree, row: int, step: int) -> None:
    """Write row ``row``, predicted to ``step`` and with the teammates' looks added, into ``tree.prediction``."""
    predict(tree.rows, row, problem.process_noise, problem.step_s, problem.n4, problem.n2, tree.prediction)
    if problem.team_looks[step] > 0:
        for block in range(problem.n4 + problem.n2):
            m11, m12, m22 = (
                problem.team_information[step, block, 0],
                problem.team_information[step, block, 1],
                problem.team_information[step, block, 2],
            )
            if m11 + m22 > 0.0:
                add_information(tree.prediction, block_offset(problem, block), block < problem.n4, m11, m12, m22)


@kernel
def _find_near(problem: PackedProblem, tree: Tree, step: int, north: float, east: float) -> int:
    """List the blocks within reach of any child: relative mean position, P, det P and trace P of each."""
    reach = problem.sensor.max_range_m + problem.reach_m
    near = tree.near
    count = 0
    for block in range(problem.n4 + problem.n2):
        dn = problem.means[step, block, 0] - north
        de = problem.means[step, block, 1] - east
        if dn * dn + de * de < reach * reach:
            k = block_offset(problem, block)
            p11, p12, p22 = tree.prediction[k], tree.prediction[k + 1], tree.prediction[k + 2]
            near[count, 0] = dn
            near[count, 1] = de
            near[count, 2] = p11
            near[count, 3] = p12
            near[count, 4] = p22
            near[count, 5] = p11 * p22 - p12 * p12
            count += 1
    return count


@kernel
def _log_information_gain(
    problem: PackedProblem, near: NDArray[np.float64], count: int, dn: float, de: float, cosine: float, sine: float
) -> float:
    """``Σ log det(I + P·M)`` of one child, displaced by (dn, de) m from its parent."""
    sensor = problem.sensor
    total, product = 0.0, 1.0
    for index in range(count):
        north, east = near[index, 0] - dn, near[index, 1] - de
        if is_seen(sensor, north, east, cosine, sine):
            along, across, n, e = look_weights(sensor, north, east, cosine, sine)
            p11, p12, p22 = near[index, 2], near[index, 3], near[index, 4]
            squared = n * n + e * e
            radial = n * n * p11 + 2.0 * n * e * p12 + e * e * p22
            tangential = squared * (p11 + p22) - radial
            product *= 1.0 + along * radial + across * tangential + along * across * squared * squared * near[index, 5]
            if product > _LARGE:
                total += math.log(product)
                product = 1.0
    if product != 1.0:
        total += math.log(product)
    return total


@kernel
def expand(problem: PackedProblem, tree: Tree, row: int, step: int) -> None:
    """Generate all feasible successors of an open node.

    They are appended to ``tree.nodes``; those of the last step are only compared with the best leaf.

    Args:
        problem: The problem.
        tree: The tree; there must be room for one successor per primitive.
        row: The node's row.
        step: The successors' step, 1..T.
    """
    node = tree.row_nodes[row]
    north, east, yaw = tree.nodes[node, 0], tree.nodes[node, 1], tree.nodes[node, 2]
    cosine, sine = math.cos(yaw), math.sin(yaw)
    predict_row(problem, tree, row, step)
    base = tree.nodes[node, 3] + log_determinant(tree.prediction, problem.n4, problem.n2)
    count = _find_near(problem, tree, step, north, east)
    bounds = problem.bounds
    check, before = False, 0.0
    if bounds.constrained:
        check = not is_far_from_all(bounds, north, east)
        if check:
            before = violation_m(bounds, north, east, cosine, sine)
    generated = 0
    end = tree.counters[0]
    for primitive in range(problem.motions.shape[0]):
        ahead, right = problem.motions[primitive, 0], problem.motions[primitive, 1]
        dn, de = cosine * ahead - sine * right, sine * ahead + cosine * right
        turn_cosine, turn_sine = problem.motions[primitive, 3], problem.motions[primitive, 4]
        child_cosine = cosine * turn_cosine - sine * turn_sine
        child_sine = sine * turn_cosine + cosine * turn_sine
        penalty = 0.0
        if bounds.constrained:
            if not keeps_separation(bounds, step, north + dn, east + de):
                continue
            if check:
                after = violation_m(bounds, north + dn, east + de, child_cosine, child_sine)
                if after > before + 1e-9:
                    continue
                if before == 0.0 and not arc_is_clear(
                    bounds, north, east, cosine, sine,
                    problem.motions[primitive, 5], problem.motions[primitive, 6], problem.step_s,
                ):  # fmt: skip
                    continue
                penalty = PENALTY_PER_M * after
        cost = base + penalty - _log_information_gain(problem, tree.near, count, dn, de, child_cosine, child_sine)
        generated += 1
        if step == problem.horizon:
            if cost < tree.best[0]:
                tree.best[0] = cost
                tree.best_link[0] = row
                tree.best_link[1] = primitive
            continue
        child_yaw = yaw + problem.motions[primitive, 2]
        if child_yaw > math.pi or child_yaw <= -math.pi:
            child_yaw -= 2.0 * math.pi * math.ceil((child_yaw - math.pi) / (2.0 * math.pi))
        tree.nodes[end, 0] = north + dn
        tree.nodes[end, 1] = east + de
        tree.nodes[end, 2] = child_yaw
        tree.nodes[end, 3] = cost
        tree.links[end, 0] = row
        tree.links[end, 1] = primitive
        tree.links[end, 2] = -1
        end += 1
    tree.counters[0] = end
    tree.counters[2] += generated
    tree.counters[3] += 1


@kernel
def open_node(problem: PackedProblem, tree: Tree, node: int, step: int) -> int:
    """Compute the covariance of a node at ``step`` into the first free row; it is not yet counted as open.

    Returns:
        The row.
    """
    predict_row(problem, tree, tree.links[node, 0], step)
    cosine, sine = math.cos(tree.nodes[node, 2]), math.sin(tree.nodes[node, 2])
    for block in range(problem.n4 + problem.n2):
        north = problem.means[step, block, 0] - tree.nodes[node, 0]
        east = problem.means[step, block, 1] - tree.nodes[node, 1]
        if is_seen(problem.sensor, north, east, cosine, sine):
            along, across, n, e = look_weights(problem.sensor, north, east, cosine, sine)
            add_information(
                tree.prediction, block_offset(problem, block), block < problem.n4,
                along * n * n + across * e * e, (along - across) * n * e, along * e * e + across * n * n,
            )  # fmt: skip
    row = tree.counters[1]
    for k in range(tree.prediction.shape[0]):
        tree.rows[row, k] = tree.prediction[k]
    return row
