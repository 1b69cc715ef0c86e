"""Every entry of the catalogues holds for the simulated autopilots: the same session as ``arvi conformance``.

An entry that says why the simulated autopilot is unlike the recorded one has to differ; docs/conformance.md lists
these.
"""

import functools
from pathlib import Path

import pytest

from sim_bridge.conformance import Family, Outcome, Plan, load_catalogue
from sim_bridge.conformance.simulated import run_simulated


@functools.cache
def results(family, link, position):
    session = run_simulated(load_catalogue(family), Plan(link=link, position=position, fly=True, dangerous=True))
    assert session.problem == ""
    return {result.entry.id: result for result in session.results}


def cases():
    return [
        pytest.param(family, entry, id=f"{family}-{entry.id}-{entry.source}")
        for family in Family
        for entry in load_catalogue(family).entries
    ]


@pytest.mark.parametrize(("family", "entry"), cases())
def test_answers_as_recorded(family, entry):
    result = results(family, entry.link, entry.position)[entry.id]
    assert result.outcome is not Outcome.SKIPPED, result.reason
    if entry.unlike is None:
        assert result.reason == ""
    else:
        assert result.outcome is Outcome.DIFFERS, f"it holds now: {entry.unlike!r} is no longer true"


@pytest.mark.parametrize(("family", "least"), [(Family.PX4, 100), (Family.ARDUPILOT, 80)])
def test_catalogues_are_large(family, least):
    assert len(load_catalogue(family).entries) >= least


def test_what_differs_is_documented():
    page = (Path(__file__).parents[2] / "docs" / "conformance.md").read_text(encoding="utf-8")
    for family in Family:
        for entry in load_catalogue(family).entries:
            if entry.unlike is not None or entry.since:
                assert f"`{entry.id}`" in page
