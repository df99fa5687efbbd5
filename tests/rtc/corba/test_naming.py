"""The name service: one server, several, servers that come and go."""

from pathlib import Path
from typing import Any

import CosNaming
import pytest

from muros.findings import Finding
from muros.rtc.codes import PeerLostError, RtcError
from muros.rtc.corba import (
    Binding,
    Names,
    NameServer,
    Orb,
    RunningNameServer,
    server_address,
    split_path,
    start_name_server,
)
from muros.rtc.corba._stubs import OpenRTM, OpenRTM__POA


class Target(OpenRTM__POA.InPortCdr):  # type: ignore[misc]
    def put(self, data: bytes) -> object:
        return OpenRTM.PORT_OK


@pytest.fixture
def target(orb: Orb) -> Any:
    servant = Target()
    yield orb.activate(servant)
    orb.deactivate(servant)


@pytest.mark.parametrize(
    ("path", "parts"),
    [
        ("Motor0.rtc", [("Motor0", "rtc")]),
        ("host.host_cxt/Motor0.rtc", [("host", "host_cxt"), ("Motor0", "rtc")]),
        ("a.b.c.rtc", [("a.b.c", "rtc")]),
        ("plain", [("plain", "")]),
        (r"a\.b\/c.rtc/d\\.x", [("a.b/c", "rtc"), ("d\\", "x")]),
        (r"a.b\.c", [("a", "b.c")]),
    ],
)
def test_paths(path: str, parts: list[tuple[str, str]]) -> None:
    assert split_path(path) == parts


@pytest.mark.parametrize("path", ["", "/", "a//b", "a.b/\\"])
def test_bad_paths(path: str) -> None:
    with pytest.raises(RtcError, match="is no name"):
        split_path(path)


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("localhost", "localhost:2809"),
        (" robot:15005 ", "robot:15005"),
        ("corbaname::robot:1/", "robot:1"),
        ("corbaloc:iiop:robot", "robot:2809"),
        ("[::1]:9", "[::1]:9"),
        ("[::1]", "[::1]:2809"),
    ],
)
def test_addresses(text: str, address: str) -> None:
    assert server_address(text) == address


@pytest.mark.parametrize("text", ["", "robot:x", ":1", "robot:0", "robot:65536"])
def test_bad_addresses(text: str) -> None:
    with pytest.raises(RtcError, match="is no address"):
        server_address(text)


def test_names_are_bound_with_their_contexts_and_taken_away(
    orb: Orb, name_server: RunningNameServer, target: Any
) -> None:
    server = NameServer(orb, name_server.address)
    assert server.is_there()
    assert server.resolve("robot.host_cxt/left.cate_cxt/Motor0.rtc") is None
    assert not server.unbind("robot.host_cxt/Motor0.rtc")
    server.bind("robot.host_cxt/left.cate_cxt/Motor0.rtc", target)
    server.bind("robot.host_cxt/left.cate_cxt/Motor0.rtc", target)
    server.bind(r"robot.host_cxt/a\/b\.c.rtc", target)
    found = server.resolve("robot.host_cxt/left.cate_cxt/Motor0.rtc")
    assert found is not None
    assert found._is_equivalent(target)
    assert server.list() == [Binding("robot", "host_cxt", True)]
    assert sorted(server.list("robot.host_cxt"), key=str) == [
        Binding("a/b.c", "rtc", False),
        Binding("left", "cate_cxt", True),
    ]
    assert sorted(path for path, _ in server.walk()) == [
        "robot.host_cxt",
        r"robot.host_cxt/a\/b\.c.rtc",
        "robot.host_cxt/left.cate_cxt",
        "robot.host_cxt/left.cate_cxt/Motor0.rtc",
    ]
    assert server.unbind("robot.host_cxt/left.cate_cxt/Motor0.rtc")
    assert server.list("robot.host_cxt/left.cate_cxt") == []
    with pytest.raises(RtcError, match="not a naming context"):
        server.list(r"robot.host_cxt/a\/b\.c.rtc")
    with pytest.raises(RtcError, match=r"refuses 'nowhere.x'"):
        server.list("nowhere.x")


def test_a_walk_looks_into_contexts_once_and_has_limits(
    orb: Orb, name_server: RunningNameServer, target: Any
) -> None:
    server = NameServer(orb, name_server.address)
    server.bind("a.cxt/b.cxt/deep.rtc", target)
    server.bind("top.rtc", target)
    root = server._root()
    inner, outer = server.resolve("a.cxt/b.cxt"), server.resolve("a.cxt")
    assert inner is not None
    inner.bind_context([CosNaming.NameComponent("root", "cxt")], root)
    inner.bind_context([CosNaming.NameComponent("up", "cxt")], outer)
    inner.bind_context([CosNaming.NameComponent("self", "cxt")], inner)
    in_order = [path for path, _ in server.walk()]
    assert sorted(in_order[:2]) == ["a.cxt", "top.rtc"]
    assert in_order[2] == "a.cxt/b.cxt"
    inside = ["deep.rtc", "root.cxt", "self.cxt", "up.cxt"]
    assert sorted(in_order[3:]) == [f"a.cxt/b.cxt/{name}" for name in inside]
    assert [path for path, _ in server.walk(contexts=2)] == in_order[:3]
    assert [path for path, _ in server.walk(bindings=4)] == in_order[:4]
    assert len(list(server.walk("a.cxt/b.cxt", contexts=1))) == 4
    with pytest.raises(RtcError, match="not a naming context"):
        list(server.walk("top.rtc"))


def test_more_names_than_come_in_one_answer(orb: Orb, name_server: RunningNameServer, target: Any) -> None:
    server = NameServer(orb, name_server.address)
    for number in range(450):
        server.bind(f"c.host_cxt/n{number}.rtc", target)
    assert len(server.list("c.host_cxt")) == 450


def test_a_server_that_does_not_answer_is_an_error_of_the_peer(orb: Orb, free_port: int, target: Any) -> None:
    server = NameServer(orb, f"127.0.0.1:{free_port}")
    assert not server.is_there()
    with pytest.raises(PeerLostError, match=f"name server 127.0.0.1:{free_port} does not answer"):
        server.bind("a.rtc", target)


def test_several_servers_one_of_them_down_at_first(
    orb: Orb, name_server: RunningNameServer, free_port: int, target: Any, tmp_path: Path
) -> None:
    findings: list[Finding] = []
    names = Names(orb, [name_server.address, f"127.0.0.1:{free_port}"], report=findings.append)
    names.bind("here.host_cxt/A.rtc", target)
    names.bind("here.host_cxt/B.rtc", target)
    names.update()
    here = NameServer(orb, name_server.address)
    assert {path for path, one in here.walk() if not one.is_context} == {
        "here.host_cxt/A.rtc",
        "here.host_cxt/B.rtc",
    }
    assert [finding.code for finding in findings] == ["name-server-down"]
    with start_name_server(free_port, folder=tmp_path / "late") as late:
        names.update()
        there = NameServer(orb, late.address)
        assert there.resolve("here.host_cxt/B.rtc") is not None
        assert [finding.code for finding in findings] == ["name-server-down", "name-server-up"]
        names.unbind_all()
        assert here.list("here.host_cxt") == there.list("here.host_cxt") == []
    assert names.bound == {}


def test_a_server_that_has_forgotten_is_told_again(
    orb: Orb, free_port: int, target: Any, tmp_path: Path
) -> None:
    names = Names(orb, [f"127.0.0.1:{free_port}"])
    with start_name_server(free_port, folder=tmp_path / "one"):
        names.bind("here.host_cxt/A.rtc", target)
    with start_name_server(free_port, folder=tmp_path / "two") as server:
        names.update()
        found = NameServer(orb, server.address).resolve("here.host_cxt/A.rtc")
        assert found is not None
        assert found._is_equivalent(target)


def test_a_server_remembers_what_its_folder_holds(
    orb: Orb, free_port: int, target: Any, tmp_path: Path
) -> None:
    with start_name_server(free_port, folder=tmp_path) as server:
        NameServer(orb, server.address).bind("here.host_cxt/A.rtc", target)
    with start_name_server(free_port, folder=tmp_path) as server:
        assert NameServer(orb, server.address).resolve("here.host_cxt/A.rtc") is not None


def test_names_of_others_are_told_and_left_alone(
    orb: Orb, name_server: RunningNameServer, target: Any
) -> None:
    findings: list[Finding] = []
    server = NameServer(orb, name_server.address)
    names = Names(orb, [name_server.address], report=findings.append)
    other = Target()
    theirs = orb.activate(other)
    server.bind("A.rtc", theirs)
    names.bind("A.rtc", target)
    assert [finding.code for finding in findings] == ["name-taken"]
    assert "is now the name" in findings[0].why
    server.bind("A.rtc", theirs)
    names.update()
    assert "stays there" in findings[1].why
    found = server.resolve("A.rtc")
    assert found is not None
    assert found._is_equivalent(theirs)
    orb.deactivate(other)
    names.update()
    found = server.resolve("A.rtc")
    assert found is not None
    assert found._is_equivalent(target)
    server.bind("A.rtc", theirs)
    names.unbind("A.rtc")
    assert server.resolve("A.rtc") is not None
    with pytest.raises(RtcError):
        names.bind("a//b", target)


def test_a_port_that_is_taken_is_told(name_server: RunningNameServer, tmp_path: Path) -> None:
    port = int(name_server.address.rpartition(":")[2])
    with pytest.raises(RtcError, match="something listens there already"):
        start_name_server(port, folder=tmp_path / "other")


def test_a_server_that_does_not_start_has_last_words(free_port: int, tmp_path: Path) -> None:
    with pytest.raises(RtcError, match=r"does not start on 192.0.2.1"):
        start_name_server(free_port, host="192.0.2.1", folder=tmp_path / "x", start_seconds=5.0)
