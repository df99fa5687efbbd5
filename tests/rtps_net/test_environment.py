"""Settings from the variables of ROS 2, and what is said about bad ones."""

from typing import Any

import pytest

from muros.rtps.net import NetworkError, NetworkSettings, Range

read = NetworkSettings.from_environment


def test_nothing_set_means_domain_0_and_the_subnet() -> None:
    assert read({}) == NetworkSettings()
    assert read({"ROS_DOMAIN_ID": "", "ROS_AUTOMATIC_DISCOVERY_RANGE": "", "ROS_STATIC_PEERS": ""}) == read(
        {}
    )
    settings = read({})
    assert (settings.domain, settings.range, settings.peers, settings.interfaces) == (0, Range.SUBNET, (), ())


def test_variables() -> None:
    settings = read(
        {
            "ROS_DOMAIN_ID": "42",
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_STATIC_PEERS": "robot-1; 10.0.0.7 ;;base.local:7500;robot-1",
            "ROS_LOCALHOST_ONLY": "0",
        }
    )
    assert settings == NetworkSettings(42, Range.LOCALHOST, peers=("robot-1", "10.0.0.7", "base.local:7500"))


@pytest.mark.parametrize("word", list(Range))
def test_ranges(word: Range) -> None:
    assert read({"ROS_AUTOMATIC_DISCOVERY_RANGE": word.value}).range is word


def test_localhost_only_goes_before_range_and_peers() -> None:
    given = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_STATIC_PEERS": "10.0.0.7"}
    only = read(given | {"ROS_LOCALHOST_ONLY": "1"})
    assert (only.range, only.peers) == (Range.LOCALHOST, ())
    for other in ("0", "", "true"):  # ROS 2 knows no other word for yes
        assert read(given | {"ROS_LOCALHOST_ONLY": other}) == read(given)


def test_arguments_go_before_variables() -> None:
    given = {
        "ROS_DOMAIN_ID": "nonsense",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "nonsense",
        "ROS_STATIC_PEERS": "?",
        "ROS_LOCALHOST_ONLY": "1",
    }
    settings = read(given, domain=7, range="SUBNET", peers=("here",), interfaces=("lo",), indices=3)
    assert settings == NetworkSettings(7, Range.SUBNET, ("here",), ("lo",), indices=3)


def test_the_process_environment_is_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", "93")
    assert read() == NetworkSettings(93)


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("ROS_DOMAIN_ID", "-1"),
        ("ROS_DOMAIN_ID", "233"),
        ("ROS_DOMAIN_ID", "one"),
        ("ROS_DOMAIN_ID", "1.5"),
        ("ROS_DOMAIN_ID", "9" * 5000),
        ("ROS_DOMAIN_ID", "\N{ARABIC-INDIC DIGIT ONE}"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "localhost"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "EVERYWHERE"),
        ("ROS_STATIC_PEERS", "10.0.0.256"),
        ("ROS_STATIC_PEERS", "10.0.0"),
        ("ROS_STATIC_PEERS", "good;bad name"),
        ("ROS_STATIC_PEERS", "-dash"),
        ("ROS_STATIC_PEERS", "x" * 256),
        ("ROS_STATIC_PEERS", "host:0"),
        ("ROS_STATIC_PEERS", "host:65536"),
        ("ROS_STATIC_PEERS", "host:"),
        ("ROS_STATIC_PEERS", "fe80::1"),
    ],
)
def test_bad_values_are_told_in_one_line(variable: str, value: str) -> None:
    with pytest.raises(NetworkError) as told:
        read({variable: value})
    text = str(told.value)
    assert text.startswith(variable)
    assert "\n" not in text
    assert text.endswith(".")


@pytest.mark.parametrize(
    "wrong",
    [
        {"domain": -1},
        {"domain": 233},
        {"indices": 0},
        {"indices": 121},
        {"known_indices": 0},
        {"known_indices": 121},
        {"hops": -1},
        {"hops": 256},
        {"receive_buffer": 0},
        {"send_queue": 0},
        {"drain": 0},
        {"group": "10.0.0.1"},
        {"group": "group"},
        {"group": "240.0.0.1"},
        {"peers": ("",)},
    ],
)
def test_bad_arguments_are_told_in_one_line(wrong: dict[str, Any]) -> None:
    with pytest.raises(NetworkError) as told:
        NetworkSettings(**wrong)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("range_", "peers", "secluded"),
    [
        (Range.SUBNET, (), False),
        (Range.SYSTEM_DEFAULT, (), False),
        (Range.OFF, (), False),
        (Range.LOCALHOST, (), True),
        (Range.LOCALHOST, ("localhost", "127.0.0.1:7500"), True),
        (Range.LOCALHOST, ("localhost:7500",), True),
        (Range.LOCALHOST, ("10.0.0.7",), False),
        (Range.LOCALHOST, ("localhost.elsewhere",), False),
    ],
)
def test_seclusion_ends_where_a_peer_on_another_host_is_named(
    range_: Range, peers: tuple[str, ...], secluded: bool
) -> None:
    assert NetworkSettings(range=range_, peers=peers).secluded is secluded
