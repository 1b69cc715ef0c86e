"""Rates of what is received."""

from onboard.protocol.rate_limit import RateLimit


def test_so_many_a_second_pass_and_as_many_at_once_after_silence() -> None:
    limit = RateLimit(100.0)
    passed = [limit.lets_in(2, 0.001 * k) for k in range(3000)]
    assert sum(passed[:100]) == 100
    assert 395 <= sum(passed) <= 401, "a hundred at once, and a hundred a second"
    assert sum(limit.lets_in(2, 60.0) for _ in range(1000)) == 100


def test_one_that_floods_takes_nothing_from_another() -> None:
    limit = RateLimit(10.0)
    assert sum(limit.lets_in(2, 1.0) for _ in range(1000)) == 10
    assert limit.lets_in(3, 1.0)


def test_a_clock_that_is_set_back_blocks_nobody_for_longer_than_a_moment() -> None:
    limit = RateLimit(10.0)
    assert all(limit.lets_in(2, 1000.0) for _ in range(10))
    assert not limit.lets_in(2, 5.0)
    assert limit.lets_in(2, 5.2)
