"""docs/hardware.md shows a team's file that loads, and names files that are there."""

import re
from pathlib import Path

import yaml

from onboard.config import load_scenario
from onboard.protocol.signing_files import write_new_key

PAGE = Path("docs/hardware.md").read_text(encoding="utf-8")


def team() -> str:
    (block,) = re.findall(r"<!-- team\.yaml.*?```yaml\n(.*?)```", PAGE, re.S)
    return str(block)


def test_the_teams_file_loads_and_its_ports_are_those_of_the_table(tmp_path: Path) -> None:
    write_new_key(tmp_path / "team.key")
    path = tmp_path / "team.yaml"
    path.write_text(team(), encoding="utf-8")
    scenario = load_scenario(path)
    first = scenario.vehicles[0]
    assert f"| UDP {first.autopilot_url.removeprefix('udpin:')}+*N*−1 |" in PAGE
    assert f"| UDP {first.sensor_url.removeprefix('udpin:')}+*N*−1 |" in PAGE
    assert f"UDP {scenario.ground.share_url.removeprefix('udpin:').replace('0.0.0.0', '127.0.0.1')} |" in PAGE


def test_companions_may_each_call_their_serial_port_the_same(tmp_path: Path) -> None:
    document = yaml.safe_load(team())
    for vehicle in document["vehicles"]:
        vehicle["links"]["autopilot"] = "serial:/dev/autopilot:921600"
    path = tmp_path / "team.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    assert len({vehicle.autopilot_url for vehicle in load_scenario(path).vehicles}) == 1


def test_links_lead_to_files() -> None:
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", PAGE):
        assert (Path("docs") / target).exists(), target
