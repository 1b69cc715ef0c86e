"""The validator's findings in the words of someone who edits a YAML file: line, key path, value, what is allowed."""

from __future__ import annotations

import json
import re
from typing import Any

from pydantic import BaseModel, ValidationError

from onboard.config.patterns import PATTERN_MEANING
from onboard.config.yaml_file import Location, YamlFile, key_path, shown

__all__ = ["describe"]

_OWN_MESSAGE = re.compile(r"(?P<keys>[a-z_]+(?:\[\d+\]|\.[a-z_]+)*): (?P<text>.*)", re.DOTALL)
"""A validator of a section names the key at fault in front of its text."""

_KEY = re.compile(r"[a-z_]+|\d+")
_EXPONENT = re.compile(r"[-+]?\d+[eE][-+]?\d+|[-+]?\d*\.\d*[eE]\d+")


def describe(file: YamlFile, model: type[BaseModel], error: ValidationError) -> str:
    """One line for each mistake, in the order of the file.

    Args:
        file: What was validated.
        model: Against what.
        error: What was found.
    """
    found: dict[Location, list[str]] = {}
    for item in error.errors():
        location, problem = _problem(model, item)
        problems = found.setdefault(location, [])
        if problem not in problems:
            problems.append(problem)
    lines = [(file.line(location), location, problems) for location, problems in found.items()]
    return "\n".join(
        f"{file.path}:{line}: {key_path(location) or 'scenario'}: {', or '.join(problems)}"
        for line, location, problems in sorted(lines, key=lambda entry: entry[0])
    )


def _problem(model: type[BaseModel], item: Any) -> tuple[Location, str]:
    location: Location = item["loc"]
    kind, context = item["type"], item.get("ctx", {})
    if kind == "missing":
        return location, "is missing"
    if kind == "extra_forbidden":
        return location, f"unknown key; known here are {_known_keys(model, location[:-1])}"
    if kind == "value_error":
        message = str(context["error"])
        own = _OWN_MESSAGE.fullmatch(message)
        if own is None:
            return location, message
        keys = tuple(int(key) if key.isdigit() else key for key in _KEY.findall(own["keys"]))
        return (*location, *keys), own["text"]
    if location[-1] == "[key]":
        return location[:-1], f"as a name it {_expectation(item)}"
    if location[-1] in {"int", "float"}:  # the alternatives of a number of either kind
        location = location[:-1]
    value = item["input"]
    given = "" if isinstance(value, (dict, list)) else f"{shown(json.dumps(value, ensure_ascii=False))} "
    return location, given + _expectation(item)


def _expectation(item: Any) -> str:
    """What is allowed: "should …"."""
    kind, context = item["type"], item.get("ctx", {})
    if kind in {"model_type", "dict_type", "model_attributes_type"}:
        return "should be a mapping of keys"
    if kind in {"tuple_type", "list_type"}:
        return "should be a list"
    if kind == "too_long":
        return f"should have at most {context['max_length']} entries, not {context['actual_length'] or 'more'}"
    if kind == "too_short":
        return f"should have at least {context['min_length']} entries, not {context['actual_length']}"
    if kind == "string_pattern_mismatch":
        return PATTERN_MEANING[context["pattern"]]
    message = re.sub(r"^(Input|String) ", "", str(item["msg"]))
    if kind in {"float_type", "int_type"} and isinstance(item["input"], str) and _EXPONENT.fullmatch(item["input"]):
        message += "; YAML takes an exponent only after a decimal point and with a sign, as in 1.0e-3"
    return message


def _known_keys(model: type[BaseModel], location: Location) -> str:
    """The keys of the section at a location, from the schema itself."""
    schema = model.model_json_schema()
    node: dict[str, Any] = schema
    for part in location:
        node = _resolve(schema, node)
        node = node.get("items", {}) if isinstance(part, int) else node.get("properties", {}).get(part, {})
    return ", ".join(_resolve(schema, node).get("properties", {})) or "none"


def _resolve(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    node = next((option for option in node.get("anyOf", []) if "$ref" in option), node)
    reference = node.get("$ref")
    if reference is None:
        return node
    definition: dict[str, Any] = schema["$defs"][reference.rsplit("/", 1)[1]]
    return definition
