"""A scenario whose key is missing is refused by every command that would fly it, with the file and what to do."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from gcs.cli import app

FIELD = Path(__file__).parents[2] / "configs" / "field.yaml"


@pytest.mark.parametrize("command", [["check"], ["fly", "--headless", "--no-record"], ["onboard", "--vehicle", "1"]])
def test_without_its_key_nothing_starts(tmp_path: Path, command: list[str]) -> None:
    config = tmp_path / "field.yaml"
    config.write_text(FIELD.read_text())
    done = CliRunner().invoke(app, [command[0], str(config), *command[1:]])
    assert done.exit_code == 2
    assert f"signing key {tmp_path}/team.key: No such file" in done.output
    assert f"arvi keygen {tmp_path}/team.key" in done.output
