"""Compiled code is kept on disk, and never outlives its sources."""

import importlib.util
import sys

import pytest

from onboard.planning import jit

SOURCE = """
from onboard.planning.jit import entry_kernel

@entry_kernel
def answer(x):
    return x + {constant}
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    file = tmp_path / "probe.py"

    def load(constant):
        file.write_text(SOURCE.format(constant=constant))
        jit.source_digest.cache_clear()
        spec = importlib.util.spec_from_file_location("probe", file)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.answer

    yield load
    jit.source_digest.cache_clear()


def test_the_second_load_comes_from_disk(load):
    assert load(1)(1) == 2
    again = load(1)
    assert again(1) == 2
    assert sum(again.stats.cache_hits.values()) == 1


def test_changed_sources_are_compiled_anew(load):
    assert load(1)(1) == 2
    changed = load(5)
    assert changed(1) == 6
    assert sum(changed.stats.cache_hits.values()) == 0


def test_a_change_in_another_of_the_planners_modules_counts_too(load, monkeypatch):
    load(1)(1)
    original = jit.source_digest
    monkeypatch.setattr(jit, "source_digest", lambda *folder: "other text" if not folder else original(*folder))
    monkeypatch.setattr(jit.source_digest, "cache_clear", lambda: None, raising=False)
    after = load(1)
    assert after(1) == 2
    assert sum(after.stats.cache_hits.values()) == 0
