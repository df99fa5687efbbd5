"""Hashes: RIHS01 as ROS 2 publishes them and as rosbags computes them, md5 sums as ROS 1 Noetic has them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from muros import interfaces
from muros.interfaces import InterfaceError, Registry, md5, rihs01, text
from muros.interfaces._hashes import rihs01 as rihs01_in
from muros.interfaces._standard import PACKAGES, SHARE, distros, stored_names

VECTORS = Path(__file__).parents[1] / "vectors"
PUBLISHED: dict[str, str] = json.loads((VECTORS / "types/rihs01.json").read_text())["hashes"]
NOETIC: dict[str, Any] = json.loads((VECTORS / "rosserial/md5_noetic.json").read_text())


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_rihs01(name: str) -> None:
    for distro in ("jazzy", "lyrical"):
        assert rihs01(name, distro) == "RIHS01_" + PUBLISHED[name]


@pytest.mark.parametrize("distro", distros())
def test_rihs01_of_all_standard_messages_as_rosbags(distro: str) -> None:
    store = get_typestore(Stores(f"ros2_{distro}"))
    # ROS 2 hashes the char of a .msg file as uint8 (see the published hash of std_msgs/msg/Char), rosbags as char.
    store.fielddefs = json.loads(json.dumps(store.fielddefs).replace('"char"', '"uint8"'))
    registry = Registry(distro)
    for name in store.types:
        assert rihs01_in(registry, name) == store.hash_rihs01(name), name


@pytest.mark.parametrize("name", NOETIC["messages"])
def test_md5_of_noetic_messages(name: str) -> None:
    assert md5(name) == NOETIC["messages"][name]


@pytest.mark.parametrize("name", NOETIC["services"])
def test_md5_of_noetic_services(name: str) -> None:
    full = name.replace("/", "/srv/")
    expected = NOETIC["services"][name]
    assert md5(full) == expected["service"]
    assert md5(f"{full}_Request") == expected["request"]
    assert md5(f"{full}_Response") == expected["response"]


def test_md5_of_all_noetic_messages_as_rosbags() -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    for name in store.types:
        if name not in ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"):
            assert md5(name) == store.generate_msgdef(name)[1], name


def test_md5_of_a_users_own_message(tmp_path: Path) -> None:
    (tmp_path / "own_msgs/msg").mkdir(parents=True)
    (tmp_path / "own_msgs/msg/Own.msg").write_text(
        "# comment\nHeader header\ntime[] when\nint8 A = 5 # x\nstring B=a # b\nInner[2] i\nchar c\n"
    )
    (tmp_path / "own_msgs/msg/Inner.msg").write_text("float32 x\n")
    (tmp_path / "own_msgs/srv").mkdir()
    (tmp_path / "own_msgs/srv/Ask.srv").write_text("Inner i\n---\nInner i\n")
    interfaces.add_path(tmp_path)
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("float32 x\n", "own_msgs/msg/Inner"))
    store.register(
        get_types_from_msg(
            "Header header\ntime[] when\nint8 A = 5\nstring B=a # b\nInner[2] i\nchar c\n", "own_msgs/msg/Own"
        )
    )
    assert md5("own_msgs/msg/Own") == store.generate_msgdef("own_msgs/msg/Own")[1]
    assert len(md5("own_msgs/srv/Ask")) == 32
    with pytest.raises(InterfaceError, match="no md5 sum of actions"):
        md5("example_interfaces/action/Fibonacci")


def test_text_names_each_nested_message_once() -> None:
    full = text("sensor_msgs/msg/Imu")
    assert full.startswith("std_msgs/Header header\n")
    nested = [line.split()[1] for line in full.splitlines() if line.startswith("MSG:")]
    assert nested == [
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "geometry_msgs/Quaternion",
        "geometry_msgs/Vector3",
    ]
    types = get_types_from_msg(full, "sensor_msgs/msg/Imu")
    assert set(types) == {"sensor_msgs/msg/Imu", *(name.replace("/", "/msg/") for name in nested)}
    assert "w 1.0" in text("geometry_msgs/msg/Quaternion")
    assert text("std_srvs/srv/SetBool") == "bool data\n---\nbool success\nstring message\n"


def test_the_list_of_standard_packages_is_complete() -> None:
    stored = {name.partition("/")[0] for distro in distros() for name in stored_names(distro)}
    assert stored | {folder.name for folder in SHARE.iterdir()} == PACKAGES


def test_every_standard_definition_is_whole() -> None:
    for distro in ("humble", "lyrical"):
        registry = Registry(distro)
        for name in registry.names():
            if distro == "lyrical" or name.split("/")[1] == "msg":
                registry.definition(name)
