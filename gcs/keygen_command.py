"""``arvi keygen``: a new signing key for a team."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gcs.arguments import refuse

__all__ = ["keygen"]


def keygen(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Where to write it, e.g. team.key; never replaced.")],
) -> None:
    """Make a signing key for a team: 32 random bytes, readable by its owner alone.

    Copy it to every vehicle and to the ground station, each with mode 0600, and name it in the scenario, relative to
    the scenario's file:

        signing: {key_file: team.key}

    From then on peers and ground refuse what the key did not sign, but for the telemetry of autopilots, which have no
    such key. A new key takes effect when the processes start again: change it while the vehicles are on the ground.

    **Example**: `arvi keygen team.key`

    Exits with 2 when the file exists or cannot be written.
    """
    from onboard.protocol.signing import SigningError  # noqa: PLC0415 - the dialect loads for a moment
    from onboard.protocol.signing_files import write_new_key  # noqa: PLC0415

    try:
        write_new_key(path)
    except SigningError as error:
        refuse(str(error))
    typer.echo(f"{path}: a new key, mode 0600. Name it in a scenario beside it as  signing: {{key_file: {path.name}}}")
