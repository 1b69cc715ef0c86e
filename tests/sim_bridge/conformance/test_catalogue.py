"""Catalogues: what they may say, and how their mistakes are told."""

import pytest

from sim_bridge.conformance.catalogue import CatalogueError, Family, load_catalogue, parse_catalogue

HEAD = "family: px4\nrecorded: none\nmodes: {LOITER: 50593792}\nentries:\n"


def entry(*steps, extra=""):
    lines = [f"    - {step}" for step in steps]
    return "\n".join([f"- id: a/b\n  source: here\n  state: ready\n{extra}  steps:", *lines, ""])


@pytest.mark.parametrize("family", list(Family))
def test_every_entry_names_a_source_and_expects_something(family):
    for found in load_catalogue(family).entries:
        assert found.source
        for steps in (found.steps, *(steps for steps in found.since.values() if steps)):
            kinds = {type(step).__name__ for step in steps}
            assert kinds & {"Ack", "Expect", "Never", "Shows", "Keeps", "Moves", "Rate", "Text", "Ready"}, found.id


@pytest.mark.parametrize(
    ("text", "mistake"),
    [
        (entry("{expect: NO_SUCH}"), "a/b: step 1: NO_SUCH: the dialect has no such message"),
        (entry("{command: NO_SUCH}"), "a/b: step 1: NO_SUCH: the dialect has no such command"),
        (entry("{shows: {mode: DANCE}}"), "a/b: step 1: DANCE: not among the catalogue's modes"),
        (entry("{text: '('}"), "a/b: step 1: '\\('"),
        (entry("{wait: 1}") * 2, "a/b: there are two entries of this name"),
        (entry("{wait: long}"), "entries.0.steps.0"),
        (entry("{wait: 1}", extra="  colour: red\n"), "entries.0.colour"),
        ("- id: [", "while parsing"),
    ],
)
def test_mistakes_name_their_entry(text, mistake):
    with pytest.raises(CatalogueError, match=mistake):
        parse_catalogue(HEAD + text, "mine.yaml")


def test_a_release_may_do_otherwise():
    extra = '  since:\n    "1.16": [{wait: 2}]\n    "2.0": []\n'
    found = parse_catalogue(HEAD + entry("{wait: 1}", extra=extra), "mine.yaml").entries[0]
    waits = [[step.wait for step in found.steps_for(release)] for release in (None, (1, 15), (1, 16), (1, 99), (2, 0))]
    assert waits == [[1], [1], [2], [2], []]


def test_what_may_start_motors_is_known():
    flying = {found.id for found in load_catalogue(Family.PX4).entries if found.flies}
    assert {"arm/before-ready", "land/by-command", "setpoint/velocity-yaw", "disarm/forced-in-the-air"} <= flying
    assert not {"request/home-position", "parameter/list", "mode/position", "disarm/when-disarmed"} & flying
