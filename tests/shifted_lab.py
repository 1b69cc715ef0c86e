"""The lab scenario on ports far above the usual ones, so that a test may run beside a flight and beside other tests."""

import os
from pathlib import Path
from typing import Any

import yaml

__all__ = ["LAB", "SHIFT", "shifted_lab"]

LAB = Path(__file__).parents[1] / "configs" / "lab.yaml"
SHIFT = 20_000 + 1_000 * int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
"""How far above: each worker that runs tests has ports of its own."""


def shifted_lab() -> dict[str, Any]:
    """The scenario's content."""
    data: dict[str, Any] = yaml.safe_load(LAB.read_text(encoding="utf-8"))
    for vehicle in data["vehicles"]:
        n = vehicle["id"] - 1 + SHIFT
        vehicle["links"] = {
            "autopilot": f"udpin:127.0.0.1:{14540 + n}",
            "peers": f"udpout:127.0.0.1:{14640 + n}",
            "sensor": f"udpin:127.0.0.1:{14740 + n}",
            "ground": f"udpout:127.0.0.1:{14550 + SHIFT}",
        }
    data["ground"] = {"url": f"udpin:127.0.0.1:{14550 + SHIFT}"}
    return data
