"""What the dds engine puts into and reads out of bytes: nodes, services, names, QoS."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtps import INFINITE, XCDR1, EndpointQos
from muros.space import CDR_BE, CDR_LE, PRESETS, Durability, History, Liveliness, Qos
from muros.space._core import Limits
from muros.space.dds._dialects import Dialect, client_id, header, split_header
from muros.space.dds._discovery_info import DiscoveryInfo, InvalidDiscoveryInfo, NodeEntities
from muros.space.dds._endpoints import encapsulated
from muros.space.dds._names import service_of, type_hash
from muros.space.dds._wire_qos import from_wire, to_wire

GIDS = st.binary(min_size=16, max_size=16)
NAMES = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20)
NODES = st.builds(
    NodeEntities, NAMES, NAMES, st.lists(GIDS, max_size=4).map(tuple), st.lists(GIDS, max_size=4).map(tuple)
)
INFOS = st.builds(DiscoveryInfo, GIDS, st.lists(NODES, max_size=4).map(tuple))


class TestDiscoveryInfo:
    @given(INFOS, st.sampled_from([16, 24]))
    def test_what_is_written_is_read(self, info: DiscoveryInfo, size: int) -> None:
        body = info.body(size)
        assert DiscoveryInfo.parse_untrusted(body) == (info, size)
        assert DiscoveryInfo.parse_untrusted(body + bytes(-len(body) & 3)) == (info, size), "filled up"

    @given(st.binary(max_size=200), st.sampled_from([CDR_LE, CDR_BE, 3, 0x0A]))
    def test_any_bytes_are_read_or_refused(self, body: bytes, representation: int) -> None:
        with contextlib.suppress(InvalidDiscoveryInfo):
            DiscoveryInfo.parse_untrusted(body, representation)

    @given(INFOS, st.sampled_from([16, 24]), st.data())
    def test_what_was_damaged_is_read_or_refused(
        self, info: DiscoveryInfo, size: int, data: st.DataObject
    ) -> None:
        body = bytearray(info.body(size))
        for _ in range(data.draw(st.integers(1, 4))):
            body[data.draw(st.integers(0, len(body) - 1))] = data.draw(st.integers(0, 255))
        del body[data.draw(st.integers(0, len(body))) :]
        with contextlib.suppress(InvalidDiscoveryInfo):
            DiscoveryInfo.parse_untrusted(bytes(body))

    def test_as_ros_2_writes_it(self) -> None:
        """One node "/ns" "talker" with one reader and two writers, laid out by hand."""
        gid = bytes(range(16))
        readers, writers = (b"r" * 16,), (b"w" * 16, b"x" * 16)
        body = (
            gid
            + b"\1\0\0\0"
            + b"\4\0\0\0/ns\0"
            + b"\7\0\0\0talker\0\0"
            + b"\1\0\0\0"
            + readers[0]
            + b"\2\0\0\0"
            + b"".join(writers)
        )
        info = DiscoveryInfo(gid, (NodeEntities("/ns", "talker", readers, writers),))
        assert info.body() == body
        old = info.body(24)
        assert old[:24] == gid + bytes(8)
        assert len(old) == len(body) + 4 * 8

    def test_big_endian_is_read(self) -> None:
        body = bytes(16) + b"\0\0\0\1" + b"\0\0\0\2/\0\0\0" + b"\0\0\0\2n\0\0\0" + bytes(4) + bytes(4)
        info, size = DiscoveryInfo.parse_untrusted(body, CDR_BE)
        assert (info.nodes, size) == ((NodeEntities("/", "n", (), ()),), 16)

    def test_too_much_is_refused(self) -> None:
        for body in (bytes(5 << 20), bytes(16) + b"\xff\xff\xff\x7f", bytes(16) + b"\1\0\0\0" + b"\xff" * 4):
            with pytest.raises(InvalidDiscoveryInfo):
                DiscoveryInfo.parse_untrusted(body)


class TestDialects:
    @given(st.integers(0, 2**64 - 1), st.integers(-(2**63), 2**63 - 1), st.sampled_from([CDR_LE, CDR_BE]))
    def test_headers(self, client: int, sequence: int, representation: int) -> None:
        head = header(client, sequence, representation)
        assert len(head) == 16
        assert split_header(head + b"body", representation) == (client, sequence)
        assert split_header(head[:15], representation) is None

    def test_vendors(self) -> None:
        assert Dialect.of(b"\x01\x10") is Dialect.HEADER
        assert Dialect.of(b"\x01\x0f") is Dialect.of(b"\0\0") is Dialect.INLINE

    def test_clients_of_one_prefix_have_ids_of_their_own(self) -> None:
        assert len({client_id(bytes(12) + bytes((0, 0, i, 3))) for i in range(100)}) == 100


@given(st.binary(max_size=40), st.sampled_from([CDR_LE, CDR_BE, 7]))
def test_payloads_are_filled_up_and_say_so(data: bytes, representation: int) -> None:
    payload = encapsulated(data, representation)
    assert len(payload) % 4 == 0
    assert payload[0] << 8 | payload[1] == representation
    assert payload[4 : len(payload) - (payload[3] & 3)] == data


class TestNames:
    @pytest.mark.parametrize(
        ("topic", "service"),
        [
            ("rq/addRequest", "/add"),
            ("rr/ns/addReply", "/ns/add"),
            ("rq/addReply", ""),
            ("rt/addRequest", ""),
            ("rq/Request", ""),
            ("", ""),
        ],
    )
    def test_services(self, topic: str, service: str) -> None:
        assert service_of(topic) == service

    @pytest.mark.parametrize(
        ("type_name", "begin"),
        [
            ("std_msgs::msg::dds_::String_", "RIHS01_df668c74"),
            ("example_interfaces::srv::dds_::AddTwoInts_Request_", "RIHS01_e118de6b"),
            ("example_interfaces::srv::dds_::AddTwoInts_Response_", "RIHS01_e118de6b"),
            ("nobody_knows::msg::dds_::This_", ""),
            ("no type of ROS", ""),
            ("", ""),
        ],
    )
    def test_hashes(self, type_name: str, begin: str) -> None:
        for distro in (None, "jazzy", "no such distribution"):
            found = type_hash(type_name, distro)
            assert found[:15] == begin
            assert len(found) == (71 if begin else 0)


class TestQos:
    @pytest.mark.parametrize("name", PRESETS)
    def test_there_and_back(self, name: str) -> None:
        qos = PRESETS[name]
        assert from_wire(to_wire(qos, Limits())) == qos

    def test_times_and_kinds(self) -> None:
        qos = Qos(
            durability=Durability.TRANSIENT_LOCAL,
            history=History.KEEP_ALL,
            deadline=5,
            lifespan=6,
            liveliness=Liveliness.MANUAL_BY_TOPIC,
            lease=7,
        )
        wire = to_wire(qos, Limits())
        assert (wire.deadline, wire.lifespan, wire.lease) == (5, 6, 7)
        assert wire.representations == (XCDR1,)
        assert wire.durability_service is not None
        assert wire.durability_service.history == History.KEEP_ALL
        assert from_wire(wire) == qos

    def test_what_is_not_said(self) -> None:
        qos = from_wire(EndpointQos())
        assert (qos.history, qos.depth, qos.deadline, qos.lease) == (History.KEEP_LAST, 1, 0, 0)
        assert to_wire(Qos(), Limits()).deadline == INFINITE

    def test_depth_is_what_is_kept(self) -> None:
        assert to_wire(Qos(depth=10_000), Limits(resource_limit=100)).depth == 100
