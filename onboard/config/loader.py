"""Read a scenario from YAML; a mistake gets file, line, key path, value, and what is allowed."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import ValidationError

from onboard.config.errors import ConfigError
from onboard.config.mistakes import describe
from onboard.config.schema import Scenario
from onboard.config.yaml_file import YamlFile

__all__ = ["ConfigError", "load_scenario"]


def load_scenario(path: Path) -> Scenario:
    """The scenario in a YAML file.

    Raises:
        ConfigError: The file cannot be read, is no YAML, or holds a mistake. All mistakes that are independent of each
            other are listed, one a line.
    """
    file = YamlFile(path)
    try:
        # JSON mode is the strict mode in which lists are tuples and nothing else is converted.
        scenario = Scenario.model_validate_json(json.dumps(file.data))
    except ValidationError as error:
        raise ConfigError(describe(file, Scenario, error)) from None
    return _with_absolute_paths(scenario, path.parent)


def _with_absolute_paths(scenario: Scenario, folder: Path) -> Scenario:
    """Paths in a file mean the same wherever the program is started."""
    if scenario.signing is None:
        return scenario
    absolute = {
        name: str(folder.absolute() / Path(value).expanduser()) for name, value in scenario.signing.model_dump().items()
    }
    return scenario.model_copy(update={"signing": scenario.signing.model_copy(update=absolute)})
