"""Datagrams of other implementations, from tests/vectors/rtps."""

import base64
import json
import zlib
from functools import cache
from pathlib import Path

from muros.rtps._wire import Data, Message, parse_untrusted

PEERS = ("fastdds_2_14", "fastdds_3_2", "cyclone_11")
LOSSES = ("fastdds_2_14_loss", "cyclone_11_loss")
DIRECTORY = Path(__file__).parent.parent / "vectors" / "rtps"


@cache
def datagrams(name: str) -> tuple[bytes, ...]:
    """The payloads of one file."""
    rows = json.loads((DIRECTORY / f"{name}.json").read_text())["datagrams"]
    return tuple(
        bytes.fromhex(row["hex"]) if "hex" in row else zlib.decompress(base64.b64decode(row["zlib"]))
        for row in rows
    )


def domain_of(name: str) -> int:
    """The domain id they were captured in."""
    return int(json.loads((DIRECTORY / f"{name}.json").read_text())["domain"])


@cache
def messages(name: str) -> tuple[Message, ...]:
    """The same, parsed."""
    return tuple(map(parse_untrusted, datagrams(name)))


def samples(name: str, writer: int) -> list[Data]:
    """The DATA of one writer, given by its entity id, of all participants."""
    return [
        event
        for message in messages(name)
        for event in message.submessages
        if isinstance(event, Data) and event.writer == writer
    ]
