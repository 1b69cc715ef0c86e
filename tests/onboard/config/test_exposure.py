"""Real vehicles are signed for, or somebody has written that they are not."""

from pathlib import Path

import pytest
import yaml

from onboard.config import ConfigError, load_scenario
from onboard.config.exposure import leaves_machine

LAB = yaml.safe_load((Path(__file__).parents[3] / "configs" / "lab.yaml").read_text())


def scenario(tmp_path, links=None, external=None, **top):
    """The lab with other links or another autopilot for its second vehicle."""
    data = {**LAB, **top}
    second = {
        **LAB["vehicles"][1],
        **({"links": links} if links else {}),
        **({"external": external} if external else {}),
    }
    data["vehicles"] = [LAB["vehicles"][0], second, *LAB["vehicles"][2:]]
    path = tmp_path / "team.yaml"
    path.write_text(yaml.safe_dump(data))
    return load_scenario(path)


@pytest.mark.parametrize(
    ("url", "leaves"),
    [
        ("udpin:127.0.0.1:14540", False),
        ("udpout:127.9.9.9:14540", False),
        ("tcp:localhost:5760", False),
        ("udpin:0.0.0.0:14540", True),
        ("udpout:10.0.0.7:14550", True),
        ("udpout:ground:14550", True),
        ("mcast:239.255.0.1:14660", True),
        ("serial:/dev/ttyS1:921600", True),
    ],
)
def test_what_leaves_this_machine(url, leaves):
    assert leaves_machine(url) is leaves


REAL = [
    {"links": {"ground": "udpout:10.0.0.1:14550"}, "external": True},
    {"links": {"peers": "mcast:239.255.0.1:14660"}, "simulation": None},
    {"links": {"autopilot": "serial:/dev/ttyS1:921600"}, "external": {"pose": "estimate"}},
    {"external": {"link": "udpin:0.0.0.0:14650"}},
]


@pytest.mark.parametrize("real", REAL)
def test_a_real_vehicle_without_a_key_is_refused_with_what_to_do(tmp_path, real):
    with pytest.raises(ConfigError, match=r"signing: is missing, and vehicles\[1\] is real") as error:
        scenario(tmp_path, **real)
    for part in ("leaves this machine", "`arvi keygen team.key`", "signing: {key_file: team.key}", "unsigned: true"):
        assert part in str(error.value)


@pytest.mark.parametrize("real", REAL)
def test_it_flies_with_a_key_or_with_a_word_that_there_is_none(tmp_path, real):
    keyed = scenario(tmp_path, **real, signing={"key_file": "team.key"})
    assert keyed.signing.key_file == str(tmp_path / "team.key")
    assert scenario(tmp_path, **real, unsigned=True).unsigned
    with pytest.raises(ConfigError, match="contradicts"):
        scenario(tmp_path, **real, unsigned=True, signing={"key_file": "team.key"})


@pytest.mark.parametrize("simulated", [{}, {"external": True}, {"links": {"sensor": "udpin:0.0.0.0:14799"}}])
def test_what_is_simulated_or_stays_on_this_machine_needs_no_key(tmp_path, simulated):
    """Simulators on this machine; and vehicles that the bridge simulates, whoever can reach their ports."""
    assert scenario(tmp_path, **simulated).signing is None
