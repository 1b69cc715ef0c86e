"""The generated dialect: current, and within MAVLink's limits."""

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol import document
from onboard.protocol.generate import main

OURS = [cls for number, cls in mavlink.mavlink_map.items() if 54100 <= number < 54200]


def test_the_module_agrees_with_its_xml() -> None:
    assert main(["--check"]) == 0


def test_every_message_fits_one_frame_and_has_units_where_it_measures() -> None:
    assert {cls.msgname for cls in OURS} == set(document.USES)
    for cls in OURS:
        assert cls.unpacker.size <= 255, cls.msgname
        assert len(cls.fieldnames) <= 64, cls.msgname


def test_the_page_tells_every_message_with_its_true_size() -> None:
    page = document.PAGE.read_text(encoding="utf-8")
    for cls in OURS:
        assert f"### {cls.msgname}\n\nId {cls.id}, {cls.unpacker.size + 12} bytes at most." in page
        for field in cls.fieldnames:
            assert f"| `{field}` |" in page


def test_a_page_without_its_markers_is_refused() -> None:
    with pytest.raises(document.DocumentError, match=r"protocol.md lacks the lines"):
        document.document("# The dialect\n")


def test_what_is_written_by_hand_stays() -> None:
    page = document.PAGE.read_text(encoding="utf-8")
    assert document.document(page.replace("# The dialect", "# Our dialect")) == page.replace(
        "# The dialect", "# Our dialect"
    )
