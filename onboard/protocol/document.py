"""Generate the tables of ``docs/protocol.md`` from ``arvi.xml``, so that they cannot disagree.

The page is written by hand except for what stands between its two markers. Who sends a message to whom, and how often,
is no part of a MAVLink definition: it is told here, for each message.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

__all__ = ["PAGE", "DocumentError", "document", "frame_size"]

_ROOT = Path(__file__).parents[2]
_XML = Path(__file__).parent / "arvi.xml"
PAGE = _ROOT / "docs" / "protocol.md"

_BEGIN = "<!-- generated from onboard/protocol/arvi.xml by `make generate`: begin -->"
_END = "<!-- generated: end -->"

_FRAME_BYTES = 12
"""MAVLink 2: header of 10 bytes, checksum of 2 (https://mavlink.io/en/guide/serialization.html)."""

_SIGNATURE_BYTES = 13
_TYPE_BYTES = {"uint64_t": 8, "int64_t": 8, "double": 8, "float": 4, "uint32_t": 4, "int32_t": 4}
_TYPE_BYTES |= {"uint16_t": 2, "int16_t": 2, "uint8_t": 1, "int8_t": 1, "char": 1}


class DocumentError(Exception):
    """The page cannot be made; the text says why."""


@dataclass(frozen=True, slots=True)
class Use:
    """How a message is used.

    Attributes:
        sender: Who sends it.
        listeners: Who takes it, and from which link.
        rate: How often.
    """

    sender: str
    listeners: str
    rate: str


USES: Mapping[str, Use] = {
    "TARGET_BELIEF": Use(
        "onboard", "onboard of neighbours (peers), ground station (ground)", "each step τ, one a target"
    ),
    "TARGET_DETECTION": Use(
        "sim_bridge, or any detector",
        "onboard of that vehicle (sensor)",
        "each look of the detector, one a target seen",
    ),
    "ARVI_PLAN": Use("onboard", "onboard of neighbours (peers), ground station (ground)", "each epoch of n steps"),
    "EXPLORED_TILE": Use(
        "onboard",
        "onboard of neighbours (peers), ground station (ground)",
        "each step τ, one a tile that changed; each tile again every 16 steps, one an age",
    ),
    "PLANNER_STATUS": Use("onboard", "onboard of neighbours (peers), ground station (ground)", "each step τ"),
    "TEAMMATE_LOST": Use(
        "onboard", "onboard of neighbours (peers)", "with each PLANNER_STATUS, one a teammate that is lost"
    ),
    "TARGET_TRUTH": Use("sim_bridge", "ground station (ground)", "10 Hz, one a target"),
    "ARVI_LANDMARKS": Use("onboard", "ground station (ground)", "every other step"),
    "VEHICLE_TRUTH": Use("sim_bridge", "ground station (ground)", "10 Hz, one a vehicle"),
}


def document(page: str) -> str:
    """The page with its generated part made anew.

    Args:
        page: The page as it is.

    Raises:
        DocumentError: The page lacks its markers, or a message of the dialect is not told of in ``USES``.
    """
    begin, end = page.find(_BEGIN), page.find(_END)
    if not 0 <= begin < end:
        raise DocumentError(f"{PAGE.name} lacks the lines {_BEGIN!r} and {_END!r}")
    text = "\n".join(_generated(ET.parse(_XML).getroot()))
    return f"{page[: begin + len(_BEGIN)]}\n\n{text}\n{page[end:]}"


def frame_size(message: ET.Element) -> int:
    """Bytes of a message's longest frame on the wire, unsigned; trailing zeros of its payload are not sent."""
    return _FRAME_BYTES + sum(_field_bytes(field.attrib["type"]) for field in message.findall("field"))


def _field_bytes(field_type: str) -> int:
    name, count = re.fullmatch(r"(\w+?)(?:\[(\d+)\])?", field_type).groups()  # type: ignore[union-attr]
    return _TYPE_BYTES[name] * int(count or 1)


def _generated(root: ET.Element) -> Iterator[str]:
    messages = root.findall("messages/message")
    unknown = {message.attrib["name"] for message in messages} ^ set(USES)
    if unknown:
        raise DocumentError(f"onboard/protocol/document.py: USES and arvi.xml disagree on {', '.join(sorted(unknown))}")
    yield from _overview(messages)
    for message in messages:
        yield from _message(message)
    yield "### Enumerations"
    yield ""
    for enum in root.findall("enums/enum"):
        if enum.attrib["name"] != "MAV_CMD":
            yield from _enum(enum)
    yield "### Commands"
    yield ""
    for enum in root.findall("enums/enum"):
        if enum.attrib["name"] == "MAV_CMD":
            for entry in enum.findall("entry"):
                yield from _command(entry)


def _overview(messages: list[ET.Element]) -> Iterator[str]:
    yield "### Overview"
    yield ""
    yield f"Bytes on the wire: payload, header and checksum; a signature adds {_SIGNATURE_BYTES}."
    yield ""
    yield "| id | message | bytes at most | sent by | taken by (link) | how often |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for message in messages:
        name = message.attrib["name"]
        use = USES[name]
        cells = (
            message.attrib["id"],
            f"[{name}](#{name.lower()})",
            frame_size(message),
            use.sender,
            use.listeners,
            use.rate,
        )
        yield f"| {' | '.join(str(cell) for cell in cells)} |"
    yield ""


def _message(message: ET.Element) -> Iterator[str]:
    name, size = message.attrib["name"], frame_size(message)
    use = USES[name]
    yield f"### {name}"
    yield ""
    yield f"Id {message.attrib['id']}, {size} bytes at most. {_text(message.find('description'))}"
    yield ""
    yield f"Sent by: {use.sender}. Taken by: {use.listeners}. How often: {use.rate}."
    yield ""
    yield "| field | type | unit | meaning |"
    yield "| --- | --- | --- | --- |"
    for field in message.findall("field"):
        enum = field.attrib.get("enum")
        unit = field.attrib.get("units", "")
        meaning = _text(field) + (f" [{enum}](#{enum.lower()})" if enum else "")
        yield f"| `{field.attrib['name']}` | {field.attrib['type']} | {unit} | {meaning} |"
    yield ""


def _enum(enum: ET.Element) -> Iterator[str]:
    kind = " Bits, any of them." if enum.attrib.get("bitmask") else ""
    yield f"#### {enum.attrib['name']}"
    yield ""
    yield f"{_text(enum.find('description')) or 'More entries of the enumeration in common.xml.'}{kind}"
    yield ""
    yield "| value | name | meaning |"
    yield "| --- | --- | --- |"
    for entry in enum.findall("entry"):
        short = entry.attrib["name"].removeprefix(f"{enum.attrib['name']}_")
        yield f"| {entry.attrib['value']} | {short} | {_text(entry.find('description'))} |"
    yield ""


def _command(entry: ET.Element) -> Iterator[str]:
    yield f"#### {entry.attrib['name']}"
    yield ""
    yield f"Id {entry.attrib['value']}. {_text(entry.find('description'))}"
    yield ""
    yield "| parameter | name | unit | meaning |"
    yield "| --- | --- | --- | --- |"
    for param in entry.findall("param"):
        if param.attrib.get("reserved") != "true":
            unit = param.attrib.get("units", "")
            yield f"| {param.attrib['index']} | {param.attrib.get('label', '')} | {unit} | {_text(param)} |"
    yield ""


def _text(element: ET.Element | None) -> str:
    return " ".join((element.text or "").split()).replace("|", "\\|") if element is not None else ""
