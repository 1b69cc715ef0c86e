"""When updates are sent to browsers of different speed, in virtual time."""

from gcs.dashboard.pulse import PulseCount

PERIOD_S = 0.2


def run(answers_after_s, duration_s=60.0):
    """Times of the updates sent to a browser that answers each so long after it was sent, one after the other."""
    now_s, sent, busy_until_s = 0.0, [], 0.0
    answers = []
    count = PulseCount(lambda: now_s)
    while now_s < duration_s:
        while answers and answers[0][0] <= now_s:
            count.seen(answers.pop(0)[1])
        if count.may_send():
            sent.append(now_s)
            busy_until_s = max(busy_until_s, now_s) + answers_after_s
            answers.append((busy_until_s, count.sent))
        now_s += PERIOD_S
    return sent, max(0.0, busy_until_s - duration_s)


def test_a_quick_browser_gets_every_update():
    sent, _ = run(0.05)
    assert len(sent) == 300


def test_a_slow_browser_gets_what_it_can_take_and_never_falls_behind():
    sent, behind_s = run(0.7)
    assert 80 <= len(sent) <= 90
    assert behind_s <= 3 * 0.7


def test_one_that_takes_seconds_falls_behind_by_a_few_updates_only():
    _, behind_s = run(5.0, 300.0)
    assert behind_s <= 4 * 5.0


def test_one_that_answers_nothing_is_sent_less_and_less():
    sent, _ = run(1e9)
    assert len(sent) < 10
