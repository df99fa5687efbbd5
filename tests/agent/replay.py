"""Replays a recorded session against the agent core in virtual time and holds its answers against the recording.

Equal must be: statuses, ids, streams, sequence numbers and data, stream by stream. Not compared: times, the order
between streams, how often a message was repeated, HEARTBEATs and liveliness probes (their moment is a matter of time),
GUIDs in sample identities (ours are put into what the recorded client says later), padding.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from muros.agent import AgentCore, Event, Limits, Port
from muros.agent._messages import Locator
from muros.agent.profiles import NamedReferences, Profiles, References
from muros.agent.xml import parse_profiles_untrusted
from muros.findings import Findings
from muros.space import open_space

VECTORS = Path(__file__).parent.parent / "vectors"
WALL = 1_795_000_000_000_000_000
ACKNACK, DATA, GET_INFO, HEARTBEAT, TIMESTAMP_REPLY = 10, 9, 2, 11, 15

PROFILES = b"""<profiles>
<participant profile_name="default_xrce_participant"><rtps><name>default_xrce_participant</name></rtps></participant>
<topic profile_name="ProbeTopic__t"><name>ProbeTopic</name><dataType>probe::Blob</dataType></topic>
<data_writer profile_name="ProbeTopic__dw"><topic><kind>NO_KEY</kind><name>ProbeTopic</name>
  <dataType>probe::Blob</dataType></topic></data_writer>
<data_reader profile_name="ProbeTopic__dr"><topic><kind>NO_KEY</kind><name>ProbeTopic</name>
  <dataType>probe::Blob</dataType></topic></data_reader>
<requester profile_name="probe_requester" service_name="probe_service" request_type="Q" reply_type="P"></requester>
<replier profile_name="probe_replier" service_name="probe_service" request_type="Q" reply_type="P"></replier>
</profiles>"""


@dataclass
class Wire:
    """A link that keeps what the agent sends: (time in ms, address, message)."""

    name: str = "wire"
    sent: list[tuple[int, Any, bytes]] = field(default_factory=list)
    clock: Callable[[], int] = lambda: 0

    def send(self, message: bytes, address: Any) -> bool:
        """Keeps it."""
        self.sent.append((self.clock(), address, bytes(message)))
        return True

    def describe(self, address: Any) -> str:
        """As it is."""
        return str(address)


class Bench:
    """An agent core on one wire, with a clock that only moves when told."""

    def __init__(
        self,
        references: References | None = None,
        *,
        locator: Locator | None = None,
        url: str = "local:",
        resource_limit: int = 5000,
        **limits: Any,
    ) -> None:
        self.now = 0
        self.events: list[Event] = []
        self.findings = Findings()
        self.space = open_space(
            url,
            findings=self.findings,
            clock=lambda: WALL + self.now * 1_000_000,
            resource_limit=resource_limit,
        )
        self.core = AgentCore(
            self.space,
            references or NamedReferences(),
            self.findings,
            limits=Limits(**limits),
            wall=lambda: WALL + self.now * 1_000_000,
        )
        self.core.on_event = self.events.append
        self.wire = Wire(clock=lambda: self.now)
        self.port: Port = self.core.attach(
            self.wire, discovery_only=locator is not None, locators=lambda: [locator] if locator else []
        )
        self.core.tick(0)
        self.space.tick()

    def receive(self, message: bytes, address: Any = 0) -> None:
        """The agent gets a message from ``address``."""
        self.port.receive(message, address, self.now)
        self.space.tick()

    def advance(self, to: int) -> None:
        """Time passes until ``to``."""
        while self.now < to:
            self.now = min(to, self.now + 10)
            self.space.tick()
            self.core.tick(self.now)

    def take(self) -> list[bytes]:
        """What was sent since the last call."""
        sent, self.wire.sent = self.wire.sent, []
        return [message for _, _, message in sent]


def load(name: str) -> dict[str, Any]:
    """A recorded session by its scenario."""
    recorded: dict[str, Any] = json.loads((VECTORS / "xrce" / f"{name}.json").read_text())
    return recorded


def references_for(recorded: dict[str, Any]) -> References:
    """What the recorded agent knew of references."""
    return (
        NamedReferences()
        if "CED" in recorded["agent"]
        else Profiles(parse_profiles_untrusted(PROFILES), "probe.refs")
    )


def replay(recorded: dict[str, Any], **limits: Any) -> tuple[dict[Any, Any], dict[Any, Any], Bench]:
    """Plays the client's packets; returns the recorded and the given answers by (client, stream), and the bench."""
    bench = Bench(references_for(recorded), locator=_locator(recorded), **limits)
    theirs: list[tuple[Any, bytes]] = []
    guids: dict[bytes, bytes] = {}
    for packet in recorded["packets"]:
        message = bytes.fromhex(packet["hex"])
        client = packet.get("client", 0)
        if packet["dir"] == "a>c":
            theirs.append((client, message))
            _learn_guid(message, bench, guids)
            continue
        bench.advance(round(packet["t_ms"]))
        if packet.get("dropped"):
            continue
        for guid, ours in guids.items():
            message = message.replace(guid, ours)
        bench.receive(message, client)
    bench.advance(bench.now + 50)
    expected = by_stream(theirs)
    given = by_stream([(address, message) for _, address, message in bench.wire.sent])
    return mask_guids(expected, guids), given, bench


def by_stream(messages: list[tuple[Any, bytes]]) -> dict[Any, Any]:
    """Messages by client, session and stream: by number on reliable streams, in order of a kind on the others."""
    streams: dict[Any, Any] = {}
    for client, message in messages:
        head = 4 if message[0] >= 0x80 else 8
        stream = message[1]
        key = (client, message[0], stream)
        kind = message[head] if len(message) > head else -1
        if kind in (HEARTBEAT, GET_INFO):
            continue
        if kind == TIMESTAMP_REPLY:
            message = message[: head + 4] + bytes(16) + message[head + 20 :]
        if stream >= 0x80:
            # numbers begin anew with each CREATE_CLIENT or RESET; a repetition is equal to what it repeats
            epochs = streams.setdefault(key, [{}])
            number = int.from_bytes(message[2:4], "little")
            known = epochs[-1].get(number)
            if known is not None and known != message and number == 0:
                epochs.append({})
            epochs[-1].setdefault(number, message)
        else:
            if kind == ACKNACK and message[-1] < 0x80:
                message = message[:-5] + bytes(4) + message[-1:]  # the reference leaks memory here
            streams.setdefault((*key, kind), []).append(message)
    return streams


def _locator(recorded: dict[str, Any]) -> Locator | None:
    """Where the recorded agent said it is, when it was asked on its discovery port."""
    if not recorded["scenario"].endswith("raw_discovery"):
        return None
    answer = bytes.fromhex(next(p["hex"] for p in recorded["packets"] if p["dir"] == "a>c"))
    return Locator(answer[-7:-3], int.from_bytes(answer[-2:], "little"))


def _learn_guid(message: bytes, bench: Bench, guids: dict[bytes, bytes]) -> None:
    """Where the recorded agent handed a request to a replier, ours did at the same number: same place, our GUID."""
    head = 4 if message[0] >= 0x80 else 8
    if len(message) < head + 32 or message[head] != DATA or message[head + 7] & 0x0F != 8:
        return
    for _, _, ours in bench.wire.sent:
        if ours[: head + 8] == message[: head + 8]:
            guids[message[head + 8 : head + 24]] = ours[head + 8 : head + 24]


def mask_guids(streams: dict[Any, Any], guids: dict[bytes, bytes]) -> dict[Any, Any]:
    """The recorded answers with our GUIDs."""

    def ours(message: bytes) -> bytes:
        for guid, own in guids.items():
            message = message.replace(guid, own)
        return message

    return {
        key: [
            {n: ours(m) for n, m in epoch.items()} if isinstance(epoch, dict) else ours(epoch)
            for epoch in stream
        ]
        for key, stream in streams.items()
    }
