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
from onboard.planning.feasibility import step_penalty_m
from onboard.planning.jit import inlined_kernel, kernel
from onboard.planning.looks import PackedSensor, is_seen, look_weights
from onboard.planning.packing import PackedBlocks, PackedProblem
from onboard.planning.tree import (
    COST,
    EAST,
    EXPANDED,
    GENERATED,
    LOG_DET,
    NODES,
    NORTH,
    PARENT,
    PRIMITIVE,
    ROW,
    ROWS,
    YAW,
    Tree,
)

__all__ = ["PENALTY_PER_M", "block_offset", "expand", "look_from", "open_node", "predict_row"]

PENALTY_PER_M = 1e5
"""What a metre of violation adds to J at each step, so that a robot outside its bounds goes back in first."""

_LARGE = 1e100


@inlined_kernel
def block_offset(blocks: PackedBlocks, block: int) -> int:
    """Where a block begins in a packed row."""
    return FOUR * block if block < blocks.n4 else FOUR * blocks.n4 + TWO * (block - blocks.n4)


@kernel
def predict_row(
    blocks: PackedBlocks, rows: NDArray[np.float64], row: int | np.int64, step: int, out: NDArray[np.float64]
) -> None:
    """Write row ``row``, predicted to ``step`` and with the teammates' looks added, into ``out``, shape (L,)."""
    predict(rows, row, blocks.process_noise, blocks.step_s, blocks.n4, blocks.n2, out)
    if blocks.team_looks[step] > 0:
        for block in range(blocks.n4 + blocks.n2):
            m11 = blocks.team_information[step, block, 0]
            m12 = blocks.team_information[step, block, 1]
            m22 = blocks.team_information[step, block, 2]
            if m11 + m22 > 0.0:
                add_information(out, block_offset(blocks, block), block < blocks.n4, m11, m12, m22)


@kernel
def look_from(
    blocks: PackedBlocks, sensor: PackedSensor, step: int, north: float, east: float, yaw: float,
    packed: NDArray[np.float64],
) -> None:  # fmt: skip
    """Add to a predicted row, shape (L,), what the robot sees from a pose at ``step``."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    for block in range(blocks.n4 + blocks.n2):
        dn, de = blocks.means[step, block, 0] - north, blocks.means[step, block, 1] - east
        if is_seen(sensor, dn, de, cosine, sine):
            along, across, n, e = look_weights(sensor, dn, de, cosine, sine)
            add_information(
                packed, block_offset(blocks, block), block < blocks.n4,
                along * n * n + across * e * e, (along - across) * n * e, along * e * e + across * n * n,
            )  # fmt: skip


@inlined_kernel
def _find_near(
    blocks: PackedBlocks, prediction: NDArray[np.float64], step: int, north: float, east: float, reach: float,
    near: NDArray[np.float64],
) -> int:  # fmt: skip
    """List the blocks that any child may see."""
    count = np.int64(0)
    for block in range(blocks.n4 + blocks.n2):
        dn, de = blocks.means[step, block, 0] - north, blocks.means[step, block, 1] - east
        if dn * dn + de * de < reach * reach:
            k = block_offset(blocks, block)
            p11, p12, p22 = prediction[k], prediction[k + 1], prediction[k + 2]
            near[count, 0], near[count, 1] = dn, de
            near[count, 2], near[count, 3], near[count, 4] = p11, p12, p22
            near[count, 5] = p11 * p22 - p12 * p12
            count += 1
    return int(count)


@kernel
def _log_gain(
    sensor: PackedSensor, near: NDArray[np.float64], count: int, dn: float, de: float, cosine: float, sine: float
) -> float:
    """``Σ log det(I + P·M)`` of one child, displaced by (dn, de) m from its parent."""
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
    nodes, links, motions = tree.nodes, tree.links, problem.motions
    prediction, near = tree.scratch.prediction, tree.scratch.near
    node = tree.row_nodes[row]
    north, east, yaw, cost_so_far = nodes[node, NORTH], nodes[node, EAST], nodes[node, YAW], nodes[node, COST]
    cosine, sine = math.cos(yaw), math.sin(yaw)
    predict_row(problem.blocks, tree.rows, row, step, prediction)
    predicted = log_determinant(prediction, problem.blocks.n4, problem.blocks.n2)
    reach = problem.sensor.max_range_m + problem.reach_m
    count = _find_near(problem.blocks, prediction, step, north, east, reach, near)
    generated, end = 0, tree.counters[NODES]
    for primitive in range(motions.shape[0]):
        dn = cosine * motions[primitive, 0] - sine * motions[primitive, 1]
        de = sine * motions[primitive, 0] + cosine * motions[primitive, 1]
        penalty = 0.0
        if problem.bounds.constrained:
            penalty = step_penalty_m(
                problem.bounds, step, north, east, cosine, sine, dn, de,
                motions[primitive, 3], motions[primitive, 4], motions[primitive, 5], motions[primitive, 6],
            )  # fmt: skip
            if penalty == math.inf:
                continue
        gain = 0.0
        if count > 0:
            child_cosine = cosine * motions[primitive, 3] - sine * motions[primitive, 4]
            child_sine = sine * motions[primitive, 3] + cosine * motions[primitive, 4]
            gain = _log_gain(problem.sensor, near, count, dn, de, child_cosine, child_sine)
        cost = cost_so_far + (predicted - gain) + PENALTY_PER_M * penalty
        generated += 1
        if step == problem.horizon:
            if cost < tree.best[0]:
                tree.best[0] = cost
                tree.best_link[0], tree.best_link[1] = row, primitive
            continue
        child_yaw = yaw + motions[primitive, 2]
        if child_yaw > math.pi or child_yaw <= -math.pi:
            child_yaw -= 2.0 * math.pi * math.ceil((child_yaw - math.pi) / (2.0 * math.pi))
        nodes[end, NORTH], nodes[end, EAST], nodes[end, YAW] = north + dn, east + de, child_yaw
        nodes[end, COST], nodes[end, LOG_DET] = cost, predicted - gain
        links[end, PARENT], links[end, PRIMITIVE], links[end, ROW] = row, primitive, -1
        end += 1
    tree.counters[NODES] = end
    tree.counters[GENERATED] += generated
    tree.counters[EXPANDED] += 1


@kernel
def open_node(problem: PackedProblem, tree: Tree, node: int, step: int) -> int:
    """Compute the covariance of a node at ``step`` into the first free row; it is not yet counted as open.

    Returns:
        The row.
    """
    prediction = tree.scratch.prediction
    predict_row(problem.blocks, tree.rows, np.int64(tree.links[node, PARENT]), step, prediction)
    look_from(
        problem.blocks, problem.sensor, step,
        tree.nodes[node, NORTH], tree.nodes[node, EAST], tree.nodes[node, YAW], prediction,
    )  # fmt: skip
    row = int(tree.counters[ROWS])
    for k in range(prediction.shape[0]):
        tree.rows[row, k] = prediction[k]
    return row
