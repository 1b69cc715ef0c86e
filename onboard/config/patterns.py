"""Texts of a certain form, and how to say what that form is."""

from __future__ import annotations

from types import MappingProxyType
from typing import Annotated

from pydantic import AfterValidator, Field

__all__ = [
    "PATTERN_MEANING",
    "AutopilotUrl",
    "FilePath",
    "ForwardUrl",
    "LinkUrl",
    "ListenUrl",
    "ProviderName",
    "ScenarioName",
]

_NAME = r"^[A-Za-z0-9_.\-]+$"
_PROVIDER = r"^[a-z_]+$"
_LINK = r"^(udpin|udpout|mcast):(?:[A-Za-z0-9.\-]+):([0-9]{1,5})$"
_AUTOPILOT = r"^(?:(?:udpin|udpout|mcast|tcp):[A-Za-z0-9.\-]+|serial:/[A-Za-z0-9._/:\-]+):([0-9]{1,8})$"
_FORWARD = r"^(udpin|udpout):(?:[A-Za-z0-9.\-]+):([0-9]{1,5})$"
_LISTEN = r"^udpin:(?:[A-Za-z0-9.\-]+):([0-9]{1,5})$"

PATTERN_MEANING = MappingProxyType(
    {
        _NAME: "should have letters, digits, dots, dashes and underscores only",
        _PROVIDER: "should have small letters and underscores only",
        _LINK: "should be udpin:HOST:PORT, udpout:HOST:PORT or mcast:GROUP:PORT",
        _AUTOPILOT: "should be udpin:HOST:PORT, udpout:HOST:PORT, mcast:GROUP:PORT, tcp:HOST:PORT "
        "or serial:DEVICE:BAUD",
        _FORWARD: "should be udpin:HOST:PORT or udpout:HOST:PORT",
        _LISTEN: "should be udpin:HOST:PORT",
    }
)
"""What is allowed, by regular expression."""


def _port_exists(url: str) -> str:
    if url.startswith("serial:"):
        return url
    port = int(url.rsplit(":", 1)[1])
    if not 1 <= port <= 65535:
        raise ValueError(f'"{url}" has the port {port}; ports are 1 to 65535')
    return url


FilePath = Annotated[str, Field(min_length=1, max_length=4096)]
ScenarioName = Annotated[str, Field(min_length=1, max_length=64, pattern=_NAME)]
ProviderName = Annotated[str, Field(min_length=1, max_length=40, pattern=_PROVIDER)]
LinkUrl = Annotated[str, Field(pattern=_LINK), AfterValidator(_port_exists)]
AutopilotUrl = Annotated[str, Field(pattern=_AUTOPILOT), AfterValidator(_port_exists)]
ListenUrl = Annotated[str, Field(pattern=_LISTEN), AfterValidator(_port_exists)]
ForwardUrl = Annotated[str, Field(pattern=_FORWARD), AfterValidator(_port_exists)]
