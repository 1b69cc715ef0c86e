"""Random small problems, and an oracle that shares no code with the planner."""

import itertools
import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose
from onboard.planning.planner import Planner
from onboard.planning.primitives import Primitive
from onboard.planning.problem import Block, Obstacles, Problem, Teammate
from onboard.planning.warmup import warm_kernels

REFERENCE = Path(__file__).parents[2] / "data" / "problems"


@pytest.fixture(scope="session", autouse=True)
def warm():
    warm_kernels()


@pytest.fixture(scope="session")
def planner():
    return Planner(node_limit=700_000)


@pytest.fixture(scope="session")
def reference_results():
    return json.loads((REFERENCE / "reference.json").read_text())["problems"]


@pytest.fixture(scope="session")
def reference_folder():
    return REFERENCE


def _random_covariance(rng, size):
    factor = rng.normal(size=(size, size)) * rng.uniform(0.2, 1.0)
    return factor @ factor.T + 0.05 * np.eye(size)


def random_problem(seed: int, *, horizon: int | None = None, bounded: bool = True) -> Problem:
    """All target models, landmarks, teammates, both fields of view, constant and growing noise, fence, obstacles."""
    rng = np.random.default_rng(seed)
    horizon = horizon or int(rng.integers(1, 4))
    primitives = tuple(
        Primitive(float(rng.choice([0.5, 1.0, 3.0])), float(rng.choice([-3.0, -1.0, 0.0, 1.0, 3.0])))
        for _ in range(rng.integers(1, 5))
    )
    blocks = []
    for number in range(rng.integers(1, 4)):
        model = list(TargetModel)[rng.integers(3)]
        size = model.state_size
        mean = np.concatenate([rng.uniform(-4.0, 4.0, 2), rng.normal(size=2)])[:size]
        covariance = _random_covariance(rng, size)
        blocks.append(Block(number, TargetMotion(model, float(rng.uniform(0.001, 0.2))), mean, covariance))
    sensor = RangeBearingSensor(
        range_std_m=float(rng.uniform(0.1, 0.5)),
        bearing_std_rad=float(rng.uniform(0.05, 0.2)),
        max_range_m=float(rng.uniform(1.5, 6.0)),
        fov_rad=math.tau if rng.random() < 0.4 else float(rng.uniform(0.5, 5.5)),
        noise_floor=1.0 if rng.random() < 0.4 else float(rng.uniform(0.05, 0.9)),
    )
    fence, obstacles, mates = None, None, []
    for _ in range(rng.integers(0, 3)):
        poses = np.column_stack([rng.uniform(-4, 4, (horizon, 2)), rng.uniform(-3, 3, horizon)])
        mates.append(Teammate(poses, float(rng.choice([0.0, 0.7])) if bounded else 0.0))
    if bounded and rng.random() < 0.4:
        fence = np.array([[-2.1, -2.3], [2.2, -1.9], [2.4, 2.1], [-1.9, 2.2]])
    if bounded and rng.random() < 0.3:
        obstacles = Obstacles(rng.random((12, 12)) < 0.08, -3.0, -3.0, 0.5)
    return Problem(
        pose=Pose(*(float(x) for x in rng.uniform(-0.5, 0.5, 2)), float(rng.uniform(-3, 3))),
        step_s=0.5,
        horizon=horizon,
        primitives=primitives,
        sensor=sensor,
        blocks=tuple(blocks),
        teammates=tuple(mates),
        fence=fence,
        obstacles=obstacles,
    )


@dataclass
class Oracle:
    """Exhaustive enumeration with dense joint covariances: nothing here comes from the planner's package."""

    problem: Problem

    def along(self, primitive, pose, duration_s):
        """Where eq. (12) leads, by its integral written out."""
        north, east, yaw = pose
        speed, rate = primitive.speed_m_s, primitive.yaw_rate_rad_s
        if rate == 0.0:
            return north + speed * duration_s * math.cos(yaw), east + speed * duration_s * math.sin(yaw), yaw
        end = yaw + rate * duration_s
        radius = speed / rate
        return north + radius * (math.sin(end) - math.sin(yaw)), east - radius * (math.cos(end) - math.cos(yaw)), end

    def inside(self, north, east):
        fence, result = self.problem.fence, False
        for (an, ae), (bn, be) in zip(fence, np.roll(fence, 1, axis=0), strict=True):
            if (ae > east) != (be > east) and north < (bn - an) * (east - ae) / (be - ae) + an:
                result = not result
        return result

    def is_open(self, north, east):
        grid = self.problem.obstacles
        row = math.floor((north - grid.origin_north_m) / grid.cell_m)
        column = math.floor((east - grid.origin_east_m) / grid.cell_m)
        rows, columns = grid.blocked.shape
        return not (0 <= row < rows and 0 <= column < columns and grid.blocked[row, column])

    def can_brake(self, pose):
        """One of the tightest circles, sampled finely, stays inside; hovering primitives are not generated here."""
        turning = [p for p in self.problem.primitives if p.yaw_rate_rad_s != 0.0]
        if not turning:
            return self.inside(pose[0], pose[1])
        for side in (1.0, -1.0):
            fits = [p for p in turning if p.yaw_rate_rad_s * side > 0.0]
            if not fits:
                continue
            tight = min(fits, key=lambda p: p.speed_m_s / abs(p.yaw_rate_rad_s))
            turn_s = math.tau / abs(tight.yaw_rate_rad_s)
            if all(self.inside(*self.along(tight, pose, turn_s * share)[:2]) for share in np.linspace(0.0, 1.0, 181)):
                return True
        return False

    def allowed(self, primitive, pose, step):
        problem = self.problem
        end = self.along(primitive, pose, problem.step_s)
        for mate in problem.teammates:
            if math.dist(end[:2], mate.poses[step - 1, :2]) < mate.separation_m:
                return False
        way = [self.along(primitive, pose, problem.step_s * share) for share in np.linspace(0.0, 1.0, 97)]
        if problem.fence is not None and not (all(self.inside(*p[:2]) for p in way) and self.can_brake(end)):
            return False
        return problem.obstacles is None or all(self.is_open(*p[:2]) for p in way[1:])

    def information(self, pose, point):
        """HᵀV⁻¹H of eq. (13)-(15) with the noise law of the documentation."""
        sensor = self.problem.sensor
        dn, de = point[0] - pose[0], point[1] - pose[1]
        r = math.hypot(dn, de)
        bearing = (math.atan2(de, dn) - pose[2] + math.pi) % math.tau - math.pi
        if r >= sensor.max_range_m or (sensor.fov_rad < math.tau and abs(bearing) >= sensor.fov_rad / 2):
            return np.zeros((2, 2))
        f = sensor.noise_floor
        variance = np.diag(
            [
                sensor.range_std_m**2 * (f + (1 - f) * r / sensor.max_range_m),
                sensor.bearing_std_rad**2 * (f + (1 - f) * abs(bearing) / (sensor.fov_rad / 2)),
            ]
        )
        floored = max(r, sensor.min_range_m)
        h = np.array([[dn / r, de / r], [-de / r / floored, dn / r / floored]])
        return h.T @ np.linalg.solve(variance, h)

    def cost(self, tracks):
        """J for pose tracks (T, 3), one per robot: a Kalman filter in information form on the joint state."""
        problem, total = self.problem, 0.0
        for block in problem.blocks:
            a = block.motion.transition(problem.step_s)
            w = block.motion.process_noise(problem.step_s)
            mean, covariance = block.mean, block.covariance
            for step in range(problem.horizon):
                mean, covariance = a @ mean, a @ covariance @ a.T + w
                added = np.zeros_like(covariance)
                for track in tracks:
                    added[:2, :2] += self.information(track[step], mean)
                covariance = np.linalg.inv(np.linalg.inv(covariance) + added)
                total += np.linalg.slogdet(covariance)[1]
        return total

    def tracks(self):
        """Every feasible sequence of primitives and its poses."""
        problem = self.problem
        start_out = problem.fence is not None and not self.can_brake(problem.pose.as_tuple())
        assert not start_out, "these problems start inside"
        for controls in itertools.product(range(len(problem.primitives)), repeat=problem.horizon):
            pose, track = problem.pose.as_tuple(), []
            for step, control in enumerate(controls, start=1):
                if not self.allowed(problem.primitives[control], pose, step):
                    break
                pose = self.along(problem.primitives[control], pose, problem.step_s)
                track.append(pose)
            else:
                yield controls, track

    def best(self):
        mates = [mate.poses for mate in self.problem.teammates]
        return min((self.cost([*mates, track]) for _, track in self.tracks()), default=math.inf)


@pytest.fixture(scope="session")
def make_problem():
    return random_problem


@pytest.fixture(scope="session")
def oracle():
    return Oracle
