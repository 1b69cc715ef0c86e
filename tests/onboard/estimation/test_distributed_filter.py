"""The distributed filter of one robot against dense joint filters and independent fusion."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.errors import OnboardError
from onboard.estimation.distributed_filter import DistributedFilter
from onboard.estimation.errors import EstimationError
from onboard.estimation.measurement import Look
from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose
from onboard.messages import Belief

STEP_S = 0.5
FAR = RangeBearingSensor(0.15, math.radians(5.0), 10.0, math.radians(94.0))
WALK = TargetMotion(TargetModel.RANDOM_WALK, 0.1)
STATIC = TargetMotion(TargetModel.STATIC, 0.0)
DOUBLE = TargetMotion(TargetModel.DOUBLE_INTEGRATOR, 0.05)


def new_filter(motion=WALK, sensor=FAR, **kwargs):
    return DistributedFilter(
        motion, sensor, STEP_S, **{"initial_speed_std_m_s": 1.0, "max_message_age_steps": 4, **kwargs}
    )


def belief(sender=2, step=0, target_id=1, mean=(1.0, 2.0), covariance=None, degree=1, model=TargetModel.RANDOM_WALK):
    covariance = np.eye(len(mean)) if covariance is None else np.asarray(covariance)
    omega = np.linalg.inv(covariance)
    return Belief(sender, step, target_id, model, degree, omega @ np.asarray(mean), omega)


class DenseJointFilter:
    """The oracle: one Kalman filter in covariance form over all targets stacked, with its own models and Jacobians.

    Each look is an iterated extended update: relinearised where the update itself lands, until that stands still.
    """

    def __init__(self, means, covariances, noise):
        self.y = np.concatenate(means)
        self.n = len(means[0])
        self.sigma = np.zeros((len(self.y), len(self.y)))
        for i, block in enumerate(covariances):
            s = slice(self.n * i, self.n * (i + 1))
            self.sigma[s, s] = block
        self.noise = noise

    def predict(self):
        m, t, q = len(self.y) // self.n, STEP_S, self.noise
        if self.n == 4:
            a = np.array([[1, 0, t, 0], [0, 1, 0, t], [0, 0, 1, 0], [0, 0, 0, 1.0]])
            c, d, e = q * t**3 / 3, q * t**2 / 2, q * t
            w = np.array([[c, 0, d, 0], [0, c, 0, d], [d, 0, e, 0], [0, d, 0, e]])
        else:
            a, w = np.eye(2), q * t * np.eye(2)
        big_a, big_w = np.kron(np.eye(m), a), np.kron(np.eye(m), w)
        self.y = big_a @ self.y
        self.sigma = big_a @ self.sigma @ big_a.T + big_w

    def measure(self, index, pose, z):
        prior, point = self.y.copy(), self.y.copy()
        for iteration in range(60):
            north, east = point[self.n * index : self.n * index + 2] - [pose.north_m, pose.east_m]
            r = math.sqrt(north * north + east * east)
            alpha = math.atan2(east, north) - pose.yaw_rad
            alpha = math.atan2(math.sin(alpha), math.cos(alpha))
            h = np.zeros((2, len(prior)))
            h[0, self.n * index : self.n * index + 2] = north / r, east / r
            h[1, self.n * index : self.n * index + 2] = -east / r**2, north / r**2
            if iteration == 0:  # V at the predicted mean
                v_r = 0.15**2 * (0.1 + 0.9 * min(r / 10.0, 1.0))
                v_alpha = math.radians(5.0) ** 2 * (0.1 + 0.9 * min(abs(alpha) / math.radians(47.0), 1.0))
                v = np.diag([v_r, v_alpha])
            innovation = z - np.array([r, alpha])
            innovation[1] = math.atan2(math.sin(innovation[1]), math.cos(innovation[1]))
            gain = self.sigma @ h.T @ np.linalg.inv(h @ self.sigma @ h.T + v)
            point = prior + gain @ (innovation + h @ (point - prior))
        self.y = point
        self.sigma = self.sigma - gain @ h @ self.sigma


@pytest.mark.parametrize("motion", [WALK, DOUBLE], ids=["random_walk", "double_integrator"])
def test_single_robot_is_a_dense_joint_kalman_filter(motion):
    """Eq. (11) without neighbours, block by block in information form, is the joint filter in covariance form."""
    rng = np.random.default_rng(11)
    n = motion.model.state_size
    truth = rng.uniform(3.0, 7.0, size=(3, 2))
    starts = [np.concatenate([p + rng.normal(size=2) * 0.3, np.zeros(n - 2)]) for p in truth]
    covariances = [np.diag([0.3, 0.2, 0.5, 0.5][:n]) + 0.05 for _ in truth]
    ours = new_filter(motion)
    for i, (start, covariance) in enumerate(zip(starts, covariances, strict=True)):
        ours.receive(belief(9, 0, i, start, covariance, model=motion.model))
    oracle = DenseJointFilter(starts, covariances, motion.noise)
    for step in range(1, 40):
        oracle.predict()
        pose = Pose(*rng.uniform(-1.0, 1.0, size=2), rng.uniform(-3.0, 3.0))
        looks = []
        for i in rng.permutation(3)[: rng.integers(0, 4)]:
            r, alpha = FAR.measure(pose, *truth[i])
            z = np.array([r + rng.normal() * 0.1, math.remainder(alpha + rng.normal() * 0.05, math.tau)])
            looks.append(Look(int(i), pose, *z))
            oracle.measure(i, pose, z)
        ours.advance(step, {9}, looks)
        y = np.concatenate([track.mean for track in ours.tracks.values()])
        np.testing.assert_allclose(y, oracle.y, rtol=1e-10, atol=1e-10)
        for i, track in ours.tracks.items():
            block = oracle.sigma[n * i : n * (i + 1), n * i : n * (i + 1)]
            np.testing.assert_allclose(track.covariance, block, rtol=1e-9, atol=1e-10)
            sign, log_det = np.linalg.slogdet(2 * np.pi * np.e * block)
            assert sign == 1.0
            assert track.entropy_nats == pytest.approx(0.5 * log_det, rel=1e-9, abs=1e-9)


def test_predictions_for_planning_are_those_of_advancing_without_a_look():
    ours = new_filter(DOUBLE)
    ours.receive(belief(2, 0, 4, (1.0, 2.0, 0.3, -0.2), np.diag([1.0, 2.0, 0.5, 0.1]), model=DOUBLE.model))
    ours.advance(1, {2}, [])
    ahead = ours.predicted(5)
    now = ours.predicted(1)
    np.testing.assert_allclose(now[4][1], ours.tracks[4].covariance, rtol=1e-12)
    for step in range(2, 6):
        ours.advance(step, {2}, [])
    np.testing.assert_allclose(ahead[4][0], ours.tracks[4].mean, rtol=1e-10)
    np.testing.assert_allclose(ahead[4][1], ours.tracks[4].covariance, rtol=1e-10)
    with pytest.raises(EstimationError, match="back to step 3"):
        ours.predicted(3)


def test_a_pause_of_the_process_is_predicted_over():
    steady, paused = new_filter(), new_filter()
    for one in (steady, paused):
        one.receive(belief())
        one.advance(1, {2}, [])
    for step in range(2, 7):
        steady.advance(step, set(), [])
    paused.advance(6, set(), [])
    np.testing.assert_allclose(paused.tracks[1].covariance, steady.tracks[1].covariance, rtol=1e-12)


def test_fusion_is_of_posteriors_at_the_step_before_prediction():
    """Eq. (10): the geometric average is of p_{j,t}, then the block is predicted. The other order differs."""
    ours = new_filter()
    ours.receive(belief(sender=3, step=0, mean=(0.0, 0.0), covariance=np.diag([1.0, 4.0])))
    ours.advance(1, {3}, [])
    own = ours.tracks[1].covariance
    other = np.diag([0.5, 0.5])
    ours.receive(belief(sender=2, step=1, mean=(1.0, 1.0), covariance=other, degree=3))
    ours.advance(2, {2, 3}, [])
    kappa = 1.0 / (1.0 + 3.0)
    fused = np.linalg.inv((1.0 - kappa) * np.linalg.inv(own) + kappa * np.linalg.inv(other))
    mean = fused @ (kappa * np.linalg.inv(other) @ [1.0, 1.0])
    np.testing.assert_allclose(ours.tracks[1].covariance, fused + 0.1 * STEP_S * np.eye(2), rtol=1e-12)
    np.testing.assert_allclose(ours.tracks[1].mean, mean, rtol=1e-12)


def test_an_old_belief_is_predicted_forward_first():
    ours = new_filter()
    ours.receive(belief(sender=2, step=3))
    ours.advance(6, {2}, [])
    # two steps to 5, where it is fused alone, and one more to 6
    np.testing.assert_allclose(ours.tracks[1].covariance, np.eye(2) * (1.0 + 3 * 0.1 * STEP_S), rtol=1e-12)


def test_the_ignorance_or_silence_of_neighbours_does_not_thin_a_track():
    ours = new_filter(STATIC)
    ours.receive(belief(2, 0, model=STATIC.model))
    ours.advance(1, {2}, [])
    before = ours.tracks[1].information_matrix.copy()
    ours.receive(belief(3, 1, target_id=8, model=STATIC.model))
    ours.advance(2, {2, 3, 4, 5}, [])
    np.testing.assert_array_equal(ours.tracks[1].information_matrix, before)
    # and what a neighbour alone knows is adopted whole
    np.testing.assert_allclose(ours.tracks[8].covariance, np.eye(2), rtol=1e-12)


def test_beliefs_of_strangers_wait_until_they_are_neighbours():
    ours = new_filter()
    ours.receive(belief(sender=2, step=0))
    ours.advance(1, set(), [])
    assert not ours.tracks
    ours.advance(2, {2}, [])
    assert list(ours.tracks) == [1]
    assert ours.discovered == {1: 2}


def test_first_look_starts_a_track_with_the_measurements_covariance():
    """The covariance of polar coordinates taken to NED: oracle is a seeded sample of noisy measurements."""
    sensor = RangeBearingSensor(0.1, math.radians(2.0), 10.0, math.tau)
    pose = Pose(1.0, -2.0, 0.7)
    ours = new_filter(DOUBLE, sensor, initial_speed_std_m_s=0.8)
    ours.advance(0, set(), [Look(5, pose, 4.0, 1.2)])
    track = ours.tracks[5]
    variances = sensor.variances(4.0, 1.2)
    rng = np.random.default_rng(5)
    r = 4.0 + rng.normal(size=400_000) * math.sqrt(variances[0])
    direction = 0.7 + 1.2 + rng.normal(size=400_000) * math.sqrt(variances[1])
    cloud = np.array([1.0 + r * np.cos(direction), -2.0 + r * np.sin(direction)])
    np.testing.assert_allclose(track.mean[:2], cloud.mean(axis=1), atol=5e-3)
    np.testing.assert_allclose(track.covariance[:2, :2], np.cov(cloud), rtol=0.03, atol=1e-4)
    np.testing.assert_allclose(track.covariance[2:, 2:], 0.64 * np.eye(2), rtol=1e-12)
    np.testing.assert_allclose(track.mean[2:], 0.0, atol=1e-12)


def test_bearing_innovation_is_wrapped():
    """A target behind the robot, just across ±π: the update must not swing it around."""
    sensor = RangeBearingSensor(0.1, math.radians(2.0), 10.0, math.tau)
    pose = Pose(0.0, 0.0, 0.0)
    ours = new_filter(WALK, sensor)
    ours.receive(belief(mean=(-5.0, 0.05), covariance=0.04 * np.eye(2)))
    ours.advance(1, {2}, [Look(1, pose, 5.0, -math.pi + 0.01)])
    assert ours.tracks[1].mean == pytest.approx([-5.0, 0.0], abs=0.06)


def test_implausible_looks_are_refused_and_counted():
    ours = new_filter()
    pose = Pose(0.0, 0.0, 0.0)
    bad = [(math.nan, 0.0), (5.0, math.inf), (12.0, 0.0), (-3.0, 0.0)]
    ours.advance(0, set(), [Look(1, pose, r, a) for r, a in bad])
    assert not ours.tracks
    assert (ours.counts.looks, ours.counts.looks_refused) == (0, 4)


def test_time_does_not_run_backwards():
    ours = new_filter()
    ours.advance(3, set(), [])
    with pytest.raises(EstimationError, match="cannot advance to step 3"):
        ours.advance(3, set(), [])


def test_forgotten_targets_are_gone_and_can_come_back():
    ours = new_filter()
    ours.receive(belief(step=0))
    ours.advance(1, {2}, [])
    ours.receive(belief(step=1))
    last = ours.tracks[1]
    assert ours.forget(1) is last
    assert ours.counts.forgotten == 1
    assert not ours.tracks
    ours.advance(2, {2}, [])
    assert not ours.tracks
    with pytest.raises(EstimationError, match="no track"):
        ours.forget(1)
    ours.receive(belief(step=2))
    ours.advance(3, {2}, [])
    assert list(ours.tracks) == [1]
    assert ours.discovered == {1: 1}


def test_memory_that_peers_can_take_is_bounded():
    ours = new_filter(max_targets=3)
    for target_id in range(10):
        for step in range(20):
            ours.receive(belief(step=step, target_id=target_id))
    ours.advance(20, {2}, [])
    assert len(ours.tracks) == 3
    ours.advance(21, set(), [Look(99, Pose(0.0, 0.0, 0.0), 1.0, 0.0)])
    assert len(ours.tracks) == 3
    assert ours.counts.beliefs.too_many == 7 * 20


# Late, duplicated and reordered messages


def test_each_belief_counts_once_and_stale_ones_are_counted_out():
    ours = new_filter()
    ours.advance(0, set(), [])
    ours.receive(belief(step=0))
    ours.receive(belief(step=0))
    ours.receive(belief(step=2))
    ours.receive(belief(step=-5))
    ours.advance(1, {2}, [])
    once = ours.tracks[1].information_matrix.copy()
    ours.receive(belief(step=0, covariance=0.01 * np.eye(2)))
    ours.receive(belief(step=-1, covariance=0.01 * np.eye(2)))
    ours.advance(2, {2}, [])
    np.testing.assert_allclose(
        np.linalg.inv(ours.tracks[1].information_matrix), np.linalg.inv(once) + 0.05 * np.eye(2), rtol=1e-12
    )
    counts = ours.counts.beliefs
    assert (counts.accepted, counts.fused, counts.duplicate) == (1, 1, 2)
    assert (counts.superseded, counts.too_old, counts.from_future) == (1, 1, 1)


def test_a_belief_of_the_next_step_does_not_displace_the_current_one():
    """A peer whose clock is a little ahead sends step 1 before we have fused its step 0."""
    ahead, prompt = new_filter(), new_filter()
    first, second = belief(step=0), belief(step=1, mean=(3.0, 3.0), covariance=0.3 * np.eye(2))
    for one in (ahead, prompt):
        one.advance(0, set(), [])
    ahead.receive(first)
    ahead.receive(second)
    prompt.receive(first)
    ahead.advance(1, {2}, [])
    prompt.advance(1, {2}, [])
    prompt.receive(second)
    ahead.advance(2, {2}, [])
    prompt.advance(2, {2}, [])
    np.testing.assert_array_equal(ahead.tracks[1].information_matrix, prompt.tracks[1].information_matrix)
    np.testing.assert_array_equal(ahead.tracks[1].information_vector, prompt.tracks[1].information_vector)


messages = st.lists(
    st.tuples(st.integers(2, 4), st.integers(0, 3), st.integers(1, 2), st.floats(0.1, 5.0)), min_size=1, max_size=12
)


@settings(deadline=None, max_examples=60)
@given(messages, st.randoms(use_true_random=False))
def test_order_and_number_of_receptions_do_not_matter(entries, random):
    """Between two steps the posterior depends on the set of beliefs heard only, to the last bit."""
    unique = {(sender, step, target): width for sender, step, target, width in entries}
    stream = [
        belief(sender, step, target, (width, -width), width * np.eye(2))
        for (sender, step, target), width in unique.items()
    ]
    shuffled = stream + random.sample(stream, k=len(stream) // 2)
    random.shuffle(shuffled)
    first, second = new_filter(), new_filter()
    for ours, order in ((first, stream), (second, shuffled)):
        ours.advance(3, set(), [])
        for item in order:
            ours.receive(item)
        ours.advance(4, {2, 3, 4}, [])
        for item in order:  # the whole stream once more, late: all of it known or overtaken
            ours.receive(item)
    alone = {target: track.covariance for target, track in first.tracks.items()}
    for ours in (first, second):
        ours.advance(5, {2, 3, 4}, [])
    assert first.tracks.keys() == second.tracks.keys()
    for target, track in first.tracks.items():
        np.testing.assert_array_equal(track.information_matrix, second.tracks[target].information_matrix)
        np.testing.assert_array_equal(track.information_vector, second.tracks[target].information_vector)
        np.testing.assert_allclose(track.covariance, alone[target] + 0.05 * np.eye(2), rtol=1e-9)


# What is refused at the door


def damaged(**changes):
    fields = {name: getattr(belief(), name) for name in Belief.__dataclass_fields__}
    return Belief(**{**fields, **changes})


@pytest.mark.parametrize(
    ("bad", "complaint"),
    [
        (damaged(model=TargetModel.DOUBLE_INTEGRATOR), "model double_integrator, this team's is random_walk"),
        (damaged(information_vector=np.zeros(4)), "shapes"),
        (damaged(information_matrix=np.eye(4)), "shapes"),
        (damaged(information_vector=np.array([np.nan, 0.0])), "not finite"),
        (damaged(information_matrix=np.array([[1.0, np.inf], [np.inf, 1.0]])), "not finite"),
        (damaged(information_matrix=np.array([[1.0, 0.5], [0.2, 1.0]])), "not symmetric"),
        (damaged(information_matrix=np.array([[1.0, 2.0], [2.0, 1.0]])), "not positive definite"),
        (damaged(information_matrix=np.array([[1.0, 1.0], [1.0, 1.0]])), "not positive definite"),
        (damaged(information_matrix=np.diag([1.0, 0.0])), "not positive definite"),
        (damaged(information_matrix=np.zeros((2, 2))), "not positive definite"),
        (damaged(information_matrix=np.diag([1e14, 1.0])), "implausible information"),
        (damaged(information_matrix=np.diag([1e-14, 1.0])), "implausible information"),
        (damaged(information_vector=np.array([1e8, 0.0])), "implausible mean"),
        (damaged(degree=-1), "degree -1"),
        (damaged(degree=256), "degree 256"),
    ],
)
def test_inconsistent_beliefs_are_refused_by_name(bad, complaint):
    ours = new_filter()
    with pytest.raises(EstimationError, match=complaint) as caught:
        ours.receive(bad)
    assert isinstance(caught.value, OnboardError)
    assert "vehicle 2 on target 1 at step 0" in str(caught.value)
    ours.advance(1, {2}, [])
    assert not ours.tracks


@settings(deadline=None, max_examples=100)
@given(seed=st.integers(0, 2**32 - 1), condition=st.floats(0.0, 4.5))
def test_single_precision_of_the_wire_keeps_beliefs_usable(seed, condition):
    """TARGET_BELIEF carries floats: rounding must neither break definiteness nor move the mean noticeably."""
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(4, 4)))
    omega = (rotation * np.logspace(0.0, condition, 4)) @ rotation.T
    omega = 0.5 * (omega + omega.T)
    mean = rng.uniform(-64.0, 64.0, size=4) * [1.0, 1.0, 0.02, 0.02]
    wire_vector = (omega @ mean).astype(np.float32).astype(np.float64)
    wire_matrix = omega.astype(np.float32).astype(np.float64)
    ours = new_filter(DOUBLE)
    ours.receive(Belief(2, 0, 1, DOUBLE.model, 1, wire_vector, wire_matrix))
    ours.advance(1, {2}, [])
    track = ours.tracks[1]
    np.linalg.cholesky(track.information_matrix)
    np.testing.assert_array_equal(track.information_matrix, track.information_matrix.T)
    a = np.eye(4) + 0.5 * np.eye(4, k=2)
    error = track.mean - a @ mean
    # at most a third of a standard deviation even at a condition number of 3e4, 64 m from the origin
    assert error @ track.information_matrix @ error < 0.1


@pytest.mark.parametrize("convert", [np.asfortranarray, lambda a: a.astype(np.float32), lambda a: a.tolist()])
def test_any_kind_of_array_is_taken_and_none_is_kept(convert):
    """A view of the sender's memory must not let it change the belief afterwards."""
    sent = belief(covariance=[[1.0, 0.25], [0.25, 0.5]])
    expected = new_filter()
    expected.receive(sent)
    expected.advance(1, {2}, [])
    ours = new_filter()
    vector, matrix = convert(sent.information_vector), convert(sent.information_matrix)
    ours.receive(Belief(2, 0, 1, sent.model, 1, vector, matrix))
    vector[0] = 1e9
    matrix[0][0] = 1e9
    ours.advance(1, {2}, [])
    np.testing.assert_allclose(ours.tracks[1].information_matrix, expected.tracks[1].information_matrix, rtol=1e-6)


# Teams


def test_static_targets_of_connected_robots_converge_to_the_truth_and_to_each_other():
    """Theorem 2: a connected line of four, of which only the first sees the target, and never all at once."""
    rng = np.random.default_rng(21)
    truth = np.array([3.0, 4.0])
    neighbours = {1: {2}, 2: {1, 3}, 3: {2, 4}, 4: {3}}
    team = {i: new_filter(STATIC) for i in neighbours}
    posts = {1: Pose(0.0, 0.0, 0.9), 4: Pose(6.0, 7.0, -2.3)}
    for step in range(400):
        for i, robot in team.items():
            looks = []
            if i in posts:
                r, alpha = FAR.measure(posts[i], *truth)
                range_variance, bearing_variance = FAR.variances(r, alpha)
                z = (r + rng.normal() * math.sqrt(range_variance), alpha + rng.normal() * math.sqrt(bearing_variance))
                looks.append(Look(1, posts[i], *z))
            robot.advance(step, neighbours[i], looks)
        for i, robot in team.items():
            for message in robot.beliefs(i, len(neighbours[i])):
                for j in neighbours[i]:
                    team[j].receive(message)
    means = np.array([robot.tracks[1].mean for robot in team.values()])
    assert np.abs(means - truth).max() < 0.03
    assert np.abs(means - means.mean(axis=0)).max() < 0.005
    assert team[1].discovered[1] == 0
    assert team[3].discovered[1] == 1


def test_information_of_a_team_is_conserved_by_consensus():
    """Without looks and noise, symmetric weights keep the team's mean information and even it out."""
    neighbours = {1: {2}, 2: {1, 3}, 3: {2}}
    team = {i: new_filter(STATIC) for i in neighbours}
    widths = {1: 0.5, 2: 2.0, 3: 7.0}
    for i, robot in team.items():
        robot.receive(belief(9, 0, 1, (1.0, 1.0), widths[i] * np.eye(2), model=STATIC.model))
        robot.advance(1, {9}, [])
    total = sum(robot.tracks[1].information_matrix for robot in team.values())
    for step in range(2, 60):
        sent = {i: robot.beliefs(i, len(neighbours[i])) for i, robot in team.items()}
        for i, robot in team.items():
            for j in neighbours[i]:
                robot.receive(sent[j][0])
            robot.advance(step, neighbours[i], [])
    np.testing.assert_allclose(sum(robot.tracks[1].information_matrix for robot in team.values()), total, rtol=1e-9)
    for robot in team.values():
        np.testing.assert_allclose(robot.tracks[1].information_matrix, total / 3, rtol=1e-6, atol=1e-9)


def nees_of_one_robot(motion, sensor, seed, *, steps, spread_m, close_m):
    """Normalised estimation error squared of every step with a look, one robot circling one target."""
    rng = np.random.default_rng(seed)
    n = motion.model.state_size
    a, w = np.eye(n), np.zeros((n, n))
    if n == 4:
        a[0, 2] = a[1, 3] = STEP_S
    noise = np.linalg.cholesky(motion.process_noise(STEP_S))
    truth = np.concatenate([rng.uniform(-1.0, 1.0, size=2), rng.normal(size=n - 2)])
    ours = new_filter(motion, sensor)
    errors = []
    for step in range(steps):
        bearing, distance = rng.uniform(-math.pi, math.pi), rng.uniform(close_m, spread_m)
        pose = Pose(
            truth[0] + distance * math.cos(bearing),
            truth[1] + distance * math.sin(bearing),
            math.remainder(bearing + math.pi + rng.uniform(-0.5, 0.5), math.tau),
        )
        r, alpha = sensor.measure(pose, truth[0], truth[1])
        range_variance, bearing_variance = sensor.variances(r, alpha)
        z_range = r + rng.normal() * math.sqrt(range_variance)
        z_bearing = math.remainder(alpha + rng.normal() * math.sqrt(bearing_variance), math.tau)
        ours.advance(step, set(), [Look(1, pose, z_range, z_bearing)])
        error = ours.tracks[1].mean - truth
        errors.append(error @ ours.tracks[1].information_matrix @ error)
        truth = a @ truth + noise @ rng.normal(size=n) + w @ truth
    return errors


@pytest.mark.parametrize(
    ("motion", "sensor", "spread_m", "close_m"),
    [
        (DOUBLE, FAR, 9.0, 2.0),
        (WALK, RangeBearingSensor(0.3, math.radians(5.0), 1.0, math.tau), 0.95, 0.3),
        (WALK, RangeBearingSensor(0.3, math.radians(5.0), 1.0, math.tau), 0.95, 0.0),
    ],
    ids=["paper's simulation", "lab", "lab, right below"],
)
def test_errors_are_as_large_as_the_covariance_says(motion, sensor, spread_m, close_m):
    """NEES has the state's size n as its mean. Right below the robot the posterior has heavier tails than a Gaussian,
    so the band is wide; one linearisation at the prediction is out of it by a factor of ten and more."""
    runs = [
        nees_of_one_robot(motion, sensor, seed, steps=40, spread_m=spread_m, close_m=close_m)[5:] for seed in range(16)
    ]
    n = motion.model.state_size
    assert 0.8 * n < np.mean(runs) < 1.5 * n
    assert np.percentile(runs, 95) < 4.0 * n
