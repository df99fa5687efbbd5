"""`muros interface`: what `ros2 interface` has besides what the types' own tests hold."""

import pytest

from muros.cli import main


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    status = main(["interface", *words])
    out, err = capsys.readouterr()
    return status, out, err


def test_list_by_kind(capsys: pytest.CaptureFixture[str]) -> None:
    services = (
        "example_interfaces/srv/AddTwoInts\nexample_interfaces/srv/SetBool\nexample_interfaces/srv/Trigger\n"
    )
    assert printed(capsys, "list", "-s", "example_interfaces") == (0, services, "")
    actions = printed(capsys, "list", "-a", "example_interfaces")[1]
    assert actions == "example_interfaces/action/Fibonacci\n"
    assert "/srv/" not in printed(capsys, "list", "--only-msgs")[1]
    packages = printed(capsys, "list", "--packages", "-a")[1].split()
    assert "example_interfaces" in packages
    assert "std_msgs" not in packages


def test_a_package_without_that_kind(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, "list", "-a", "std_msgs") == (0, "", "")


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (["std_msgs/msg/String"], "\"data: ''\n\"\n"),
        (["std_msgs/String", "--no-quotes"], "data: ''\n\n"),
        (["example_interfaces/srv/AddTwoInts"], '"a: 0\nb: 0\n"\n'),
        (["example_interfaces/action/Fibonacci"], '"order: 0\n"\n'),
    ],
)
def test_proto(words: list[str], shown: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, "proto", *words) == (0, shown, "")


def test_proto_of_an_unknown_type(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = printed(capsys, "proto", "std_msgs/msg/Strin")
    assert (status, out) == (1, "")
    assert err == "muros: unknown type 'std_msgs/msg/Strin' (did you mean std_msgs/msg/String?)\n"
