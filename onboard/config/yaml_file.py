"""Plain data from a YAML file, with the place of every value, and without trust in the file.

Only mappings with text keys, lists, finite numbers, text, booleans and null are let through. Size, depth and the work
that aliases can cause are bounded: a few hundred bytes of nested aliases stand for more data than any machine holds.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import yaml

from onboard.config.errors import ConfigError

__all__ = ["Location", "YamlFile", "key_path", "shown"]

Location = tuple[str | int, ...]

MAX_FILE_BYTES = 250_000
MAX_DEPTH = 20
MAX_EXPANDED = 2_000_000
VALUE_COST = 50
"""Every value counts so much plus its length; aliased values count each time."""
MAX_SHOWN = 60


def key_path(location: Location) -> str:
    """A location as one writes it: ``vehicles[1].links.peers``."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")


def shown(text: str) -> str:
    """A value for an error message, cut where it is long."""
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}… ({len(text)} characters)"


class YamlFile:
    """A parsed file.

    Attributes:
        path: Where it was read from.
        data: The mapping that it holds.
    """

    def __init__(self, path: Path) -> None:
        """Read and parse.

        Raises:
            ConfigError: It cannot be read, is no YAML mapping, or holds something that configurations do not have.
        """
        self.path = path
        self._root = self._compose()
        self._left = MAX_EXPANDED
        self._loader = yaml.SafeLoader("")
        try:
            self.data: dict[str, Any] = self._mapping(self._root, ())
        finally:
            self._loader.dispose()

    def line(self, location: Location) -> int:
        """The line, from 1, of the key or list entry at a location, or of the nearest one above it in the file."""
        node: yaml.Node = self._root
        mark = node.start_mark
        for part in location:
            if isinstance(node, yaml.MappingNode):
                found = next(((key, value) for key, value in node.value if key.value == part), None)
                if found is None:
                    break
                mark, node = found[0].start_mark, found[1]
            elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
                node = node.value[part]
                mark = node.start_mark
            else:
                break
        return int(mark.line) + 1

    def _compose(self) -> yaml.MappingNode:
        path = self.path
        try:
            with path.open("rb") as stream:
                content = stream.read(MAX_FILE_BYTES + 1)
            if len(content) > MAX_FILE_BYTES:
                raise ConfigError(f"{path}: larger than {MAX_FILE_BYTES} bytes; a scenario has a few hundred lines")
            root = yaml.compose(content.decode("utf-8-sig"), Loader=yaml.SafeLoader)
        except FileNotFoundError:
            raise ConfigError(f"{path}: no such file") from None
        except OSError as error:
            raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
        except UnicodeDecodeError as error:
            raise ConfigError(f"{path}: not UTF-8 text at byte {error.start}") from None
        except RecursionError:
            raise ConfigError(f"{path}: nested more than {MAX_DEPTH} levels deep") from None
        except yaml.YAMLError as error:
            mark = getattr(error, "problem_mark", None)
            where = f":{mark.line + 1}" if mark is not None else ""
            problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "cannot be parsed"
            raise ConfigError(f"{path}{where}: not valid YAML: {problem}") from None
        if not isinstance(root, yaml.MappingNode):
            raise ConfigError(f"{path}: a scenario is a mapping of keys (name, mission, vehicles, …)")
        return root

    def _value(self, node: yaml.Node, location: Location) -> Any:
        if len(location) > MAX_DEPTH:
            raise self._error(node, location, f"nested more than {MAX_DEPTH} levels deep, or an alias of itself")
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, location)
        if isinstance(node, yaml.SequenceNode):
            self._expect_tag(node, location, "tag:yaml.org,2002:seq")
            self._spend(node, location, 0)
            return [self._value(child, (*location, index)) for index, child in enumerate(node.value)]
        return self._scalar(node, location)

    def _mapping(self, node: yaml.MappingNode, location: Location) -> dict[str, Any]:
        self._expect_tag(node, location, "tag:yaml.org,2002:map")
        self._spend(node, location, 0)
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, yaml.ScalarNode) or key_node.tag != "tag:yaml.org,2002:str":
                what = shown(key_node.value) if isinstance(key_node, yaml.ScalarNode) else "a list or mapping"
                raise self._error(key_node, location, f"{what} is not a name; keys are text")
            key = str(key_node.value)
            if key in result:
                raise self._error(key_node, (*location, key), "this key stands twice in one mapping")
            result[key] = self._value(value_node, (*location, key))
        return result

    def _scalar(self, node: yaml.Node, location: Location) -> Any:
        self._spend(node, location, len(node.value))
        try:
            value = self._loader.construct_object(node)
        except (yaml.YAMLError, ValueError):
            raise self._error(node, location, f"{shown(node.value)} cannot be read") from None
        if not isinstance(value, (str, int, float, bool, type(None))):
            raise self._error(
                node, location, f"{shown(node.value)} is neither a number, text, true, false nor null; quote text"
            )
        if isinstance(value, float) and not math.isfinite(value):
            raise self._error(node, location, f"{shown(node.value)} is not a finite number")
        return value

    def _expect_tag(self, node: yaml.Node, location: Location, tag: str) -> None:
        if node.tag != tag:
            raise self._error(node, location, f"the tag {shown(node.tag)} has no meaning here")

    def _spend(self, node: yaml.Node, location: Location, length: int) -> None:
        self._left -= VALUE_COST + length
        if self._left < 0:
            raise self._error(node, location, "too much data up to here; are aliases (*name) nested in each other?")

    def _error(self, node: yaml.Node, location: Location, problem: str) -> ConfigError:
        return ConfigError(f"{self.path}:{node.start_mark.line + 1}: {key_path(location) or 'scenario'}: {problem}")
