"""``arvi keygen``."""

from pathlib import Path

from typer.testing import CliRunner

from gcs.cli import app
from onboard.protocol.signing_files import read_key


def test_a_key_is_made_once_and_never_printed(tmp_path: Path) -> None:
    path = tmp_path / "team.key"
    made = CliRunner().invoke(app, ["keygen", str(path)])
    key = read_key(path)
    assert made.exit_code == 0
    assert key.secret.hex() not in made.output
    again = CliRunner().invoke(app, ["keygen", str(path)])
    assert (again.exit_code, "never replaced" in again.output) == (2, True)
    assert read_key(path) == key
