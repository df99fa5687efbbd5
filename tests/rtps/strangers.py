"""A participant made of bytes, for tests: it says what it likes, and keeps what is said to it."""

from typing import Any

from muros.links.testing import Datagram
from muros.rtps import EndpointData, EndpointQos, ParticipantData, udp4
from muros.rtps._constants import (
    ENTITYID_SEDP_PUBLICATIONS_WRITER,
    ENTITYID_SEDP_SUBSCRIPTIONS_WRITER,
    ENTITYID_SPDP_READER,
    ENTITYID_SPDP_WRITER,
)
from muros.rtps._discovery_data import departure
from muros.rtps._events import Event
from muros.rtps._wire import data, message, parse_untrusted
from tests.rtps.domains import TYPE, Process


class Stranger:
    """A participant made of bytes, somewhere on the network of `process`."""

    def __init__(self, process: Process, number: int = 1, **options: Any) -> None:
        self.process = process
        self.prefix = b"stranger" + number.to_bytes(4, "big")
        self.at = udp4("10.9.9.9", 7410 + number)
        self.told = ParticipantData(
            prefix=self.prefix,
            **{"metatraffic_unicast": (self.at,), "default_unicast": (self.at,), **options},
        )
        self.announced = 0
        self.sequences = dict.fromkeys(
            (ENTITYID_SEDP_PUBLICATIONS_WRITER, ENTITYID_SEDP_SUBSCRIPTIONS_WRITER), 0
        )

    def send(self, *submessages: bytes) -> None:
        """Send a message to the process."""
        self.process.core.receive(message(self.prefix, *submessages), self.at, self.process.now)

    def announce(self, **changes: Any) -> None:
        """Say that it is there."""
        self.announced += 1
        self.send(data(ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER, self.announced, self.told.payload()))

    def leave(self) -> None:
        """Say that it goes."""
        self.announced += 1
        bye = departure(self.told.guid)
        self.send(data(ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER, self.announced, b"", inline_qos=bye))

    def endpoint(self, entity: int, topic: str = "rt/a", **options: Any) -> EndpointData:
        """Tell of a writer (0x..03) or reader (0x..04)."""
        qos = options.pop("qos", EndpointQos())
        prefix = options.pop("prefix", self.prefix)
        told = EndpointData(
            guid=prefix + entity.to_bytes(4, "big"), topic=topic, type_name=TYPE, qos=qos, **options
        )
        self.say(
            ENTITYID_SEDP_PUBLICATIONS_WRITER if told.is_writer else ENTITYID_SEDP_SUBSCRIPTIONS_WRITER,
            told.payload(),
        )
        return told

    def withdraw(self, told: EndpointData) -> None:
        """Tell that one is gone."""
        writer = ENTITYID_SEDP_PUBLICATIONS_WRITER if told.is_writer else ENTITYID_SEDP_SUBSCRIPTIONS_WRITER
        self.say(writer, b"", departure(told.guid))

    def say(self, writer: int, payload: bytes, inline_qos: bytes = b"") -> None:
        """Write a sample to a topic of discovery."""
        self.sequences[writer] = self.sequences.get(writer, 0) + 1
        self.send(data(0, writer, self.sequences[writer], payload, inline_qos=inline_qos))

    def heard(self, sent: list[Datagram]) -> list[Event]:
        """What was said to it, of what was sent."""
        return [
            event
            for datagram in sent
            if datagram.receiver == self.at
            for event in parse_untrusted(datagram.data).submessages
        ]
