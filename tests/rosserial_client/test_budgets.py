"""What a board pays for rosserial on the 32-bit heap: little more than today, so that it does not get worse."""

from __future__ import annotations

from pathlib import Path

import pytest

from muros.rosserial import types
from tests.micropython.budgets import import_heap, object_heap
from tests.micropython.runtimes import require

DEVICE = "from muros.rosserial.device import Device\ndevice = Device(lambda buf, off, n: None, 256, 256)"
STRING = "'std_msgs/String', '992ce8a1687cec8c8bd883ec73ca41d1'"


@pytest.fixture(autouse=True)
def _runtimes() -> None:
    require("mpy-cross")
    require("gauge")


def test_code(tmp_path: Path) -> None:
    types.write(["std_msgs/String"], tmp_path)
    files = {f"ros1/{path.name}": path.read_bytes() for path in (tmp_path / "ros1").glob("*.py")}
    assert import_heap("import muros.rosserial.device") <= 14_300
    assert import_heap("import muros.rosserial.node_handle") <= 18_200
    assert import_heap("import muros.rosserial.node_handle, ros1.std_msgs", files) <= 21_400


def test_objects() -> None:
    assert object_heap(DEVICE, "Device(print, 256, 256)") <= 1200
    assert object_heap(DEVICE, f"device.publisher('chatter', {STRING})") <= 120
