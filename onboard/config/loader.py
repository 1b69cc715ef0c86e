"""Read a scenario from YAML; a mistake gets file, line, key path, value, and what is allowed."""

from __future__ import annotations

import json
import math
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from onboard.config.schema import Scenario
from onboard.errors import OnboardError

__all__ = ["ConfigError", "load_scenario"]

MAX_FILE_BYTES = 1_000_000


class ConfigError(OnboardError):
    """A configuration file that cannot be used; the text has one line for each mistake."""


def load_scenario(path: Path) -> Scenario:
    """The scenario in a YAML file.

    Raises:
        ConfigError: The file cannot be read, is no YAML, or holds a mistake. All mistakes are listed.
    """
    root = _compose(path)
    data = _construct(path, root)
    try:
        # JSON mode is the strict mode in which lists are tuples and nothing else is converted.
        return Scenario.model_validate_json(json.dumps(data))
    except ValidationError as error:
        raise ConfigError("\n".join(_describe(path, root, item) for item in error.errors())) from None


def _compose(path: Path) -> yaml.Node:
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise ConfigError(f"{path}: larger than {MAX_FILE_BYTES} bytes; a scenario has a few hundred lines")
        text = path.read_text(encoding="utf-8")
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not UTF-8 text at byte {error.start}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f":{mark.line + 1}" if mark is not None else ""
        problem = getattr(error, "problem", None) or "cannot be parsed"
        raise ConfigError(f"{path}{where}: not valid YAML: {problem}") from None
    if not isinstance(root, yaml.MappingNode):
        raise ConfigError(f"{path}: a scenario is a mapping of keys (name, mission, vehicles, …)")
    return root


def _construct(path: Path, node: yaml.Node) -> Any:
    """Plain data from a node, by YAML's safe tags, refusing what JSON has no word for."""
    if isinstance(node, yaml.MappingNode):
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key = _scalar(path, key_node)
            if not isinstance(key, str):
                raise ConfigError(f"{path}:{_line(key_node)}: the key {key!r} is not a name; keys are text")
            if key in result:
                raise ConfigError(f"{path}:{_line(key_node)}: the key {key!r} stands twice in one mapping")
            result[key] = _construct(path, value_node)
        return result
    if isinstance(node, yaml.SequenceNode):
        return [_construct(path, child) for child in node.value]
    return _scalar(path, node)


def _scalar(path: Path, node: yaml.Node) -> Any:
    loader = yaml.SafeLoader("")
    try:
        value = loader.construct_object(node, deep=True)
    except (yaml.YAMLError, ValueError):
        raise ConfigError(f"{path}:{_line(node)}: the value {node.value!r} cannot be read") from None
    finally:
        loader.dispose()
    if not isinstance(value, (str, int, float, bool, type(None))):
        raise ConfigError(f"{path}:{_line(node)}: {node.value!r} is neither a number, text, true, false nor null")
    if isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(f"{path}:{_line(node)}: {node.value} is not a finite number")
    return value


def _line(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1


def _describe(path: Path, root: yaml.Node, item: Any) -> str:
    location: tuple[str | int, ...] = item["loc"]
    line = _line(_deepest(root, location))
    keys = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")
    where = f"{path}:{line}: {keys or 'scenario'}"
    kind, context = item["type"], item.get("ctx", {})
    if kind == "missing":
        return f"{where}: is missing"
    if kind == "extra_forbidden":
        return f"{where}: unknown key; known here are {_known_keys(location[:-1])}"
    if kind == "value_error":
        return f"{where}: {context['error']}"
    value = item["input"]
    shown = "" if isinstance(value, (dict, list)) else f" {value!r}"
    message = str(item["msg"]).removeprefix("Input ")
    if kind == "string_pattern_mismatch" and "udp" in str(context.get("pattern")):
        message = "should be udpin:HOST:PORT, udpout:HOST:PORT or mcast:GROUP:PORT"
    return f"{where}:{shown} {message}"


def _deepest(root: yaml.Node, location: tuple[Hashable, ...]) -> yaml.Node:
    """The node at a location, or the nearest one above it that the file has."""
    node = root
    for part in location:
        child: yaml.Node | None = None
        if isinstance(node, yaml.MappingNode):
            child = next((value for key, value in node.value if key.value == part), None)
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            child = node.value[part]
        if child is None:
            break
        node = child
    return node


def _known_keys(location: tuple[str | int, ...]) -> str:
    """The keys of the section at a location, from the schema itself."""
    schema = Scenario.model_json_schema()
    node: dict[str, Any] = schema
    for part in location:
        node = _resolve(schema, node)
        node = node.get("items", {}) if isinstance(part, int) else node.get("properties", {}).get(part, {})
    return ", ".join(_resolve(schema, node).get("properties", {})) or "none"


def _resolve(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    for option in node.get("anyOf", []):
        if "$ref" in option:
            node = option
    reference = node.get("$ref") or next((part.get("$ref") for part in node.get("allOf", [])), None)
    if reference is None:
        return node
    definition: dict[str, Any] = schema["$defs"][reference.rsplit("/", 1)[1]]
    return definition
