"""Folders of runs: new ones, kept or not, with what was run beside."""

import json

import pytest

from gcs.errors import GroundError
from gcs.folder import describe_run, run_folder


def test_two_runs_of_one_second_have_two_folders(tmp_path):
    with run_folder(tmp_path / "new", "lab") as first, run_folder(tmp_path / "new", "lab") as second:
        assert first.path != second.path
        assert first.path.name.startswith("lab-")
    assert first.path.is_dir()
    assert second.path.is_dir()


def test_a_temporary_folder_goes_unless_it_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with run_folder(None, "lab") as folder:
        (folder.path / "bridge.log").write_text("text")
        folder.keep = False
    assert list(tmp_path.iterdir()) == []


def test_the_run_is_described_beside_it(tmp_path):
    config = tmp_path / "some.yaml"
    config.write_text("name: lab\n")
    describe_run(tmp_path, config, {"seed": 7})
    assert (tmp_path / "scenario.yaml").read_text() == "name: lab\n"
    about = json.loads((tmp_path / "flight.json").read_text())
    assert about["seed"] == 7
    assert about["started"]


def test_what_cannot_be_written_is_said(tmp_path):
    with pytest.raises(GroundError, match="cannot be recorded to: No such file"):
        describe_run(tmp_path, tmp_path / "gone.yaml", {})
