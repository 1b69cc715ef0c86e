"""What vehicles install is pinned with hashes, and is what pyproject.toml asks for."""

import re
import tomllib
from importlib.metadata import PackageNotFoundError, requires
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PIN = re.compile(r"^([a-z0-9-]+)==(\S+?)(?: ; (.+?))? \\$")


def pins() -> list[tuple[Requirement, int]]:
    """Each pinned release with the number of its hashes."""
    found: list[tuple[Requirement, int]] = []
    for line in (ROOT / "requirements" / "vehicle.lock").read_text().splitlines():
        if match := PIN.match(line):
            name, version, marker = match.groups()
            found.append((Requirement(f"{name}=={version}" + (f"; {marker}" if marker else "")), 0))
        elif re.match(r"^    --hash=sha256:[0-9a-f]{64}( \\)?$", line):
            found[-1] = (found[-1][0], found[-1][1] + 1)
        else:
            assert line.startswith("#"), f"neither a pin nor a hash: {line}"
    return found


def asked() -> list[Requirement]:
    lines = (ROOT / "requirements" / "vehicle.in").read_text().splitlines()
    return [Requirement(line) for line in lines if not line.startswith("#")]


def test_the_vehicles_part_is_a_part_of_the_projects_dependencies() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert {str(requirement) for requirement in asked()} <= {str(Requirement(d)) for d in project["dependencies"]}


def test_every_release_is_pinned_with_hashes_and_within_its_bounds() -> None:
    pinned = pins()
    assert all(hashes > 0 for _, hashes in pinned)
    for requirement in asked():
        versions = [str(pin.specifier).removeprefix("==") for pin, _ in pinned if pin.name == requirement.name]
        assert versions, f"{requirement.name} is not in the lock; run make lock"
        assert all(requirement.specifier.contains(version) for version in versions)


def test_what_they_need_themselves_is_pinned_too() -> None:
    names = {canonicalize_name(pin.name) for pin, _ in pins()}
    for name in names:
        try:
            needed = requires(name) or []
        except PackageNotFoundError:
            continue  # of another platform
        for text in needed:
            requirement = Requirement(text)
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                assert canonicalize_name(requirement.name) in names, f"{name} needs {requirement}; run make lock"
