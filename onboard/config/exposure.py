"""Which links leave this machine, where strangers may reach them."""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping

__all__ = ["leaves_machine", "leaving"]


def leaves_machine(url: str) -> bool:
    """Whether others than programs on this machine can be at a link: all but the loopback interface's addresses.

    Args:
        url: As ``onboard.protocol.transport`` has them; well-formed.
    """
    kind, host, _ = url.split(":", 2)
    if kind in ("serial", "mcast"):
        return True
    try:
        return not ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host != "localhost"


def leaving(urls: Mapping[str, str]) -> str | None:
    """The first of several links, by their keys in the configuration, that leaves this machine: key and URL."""
    return next((f"{name}: {url}" for name, url in urls.items() if leaves_machine(url)), None)
