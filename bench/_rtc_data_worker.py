"""What receives in bench_rtc_data.py: a plain servant and InPorts; as a program, in a process of its own.

Commands are JSON lines on standard input, answers JSON lines on standard output.
"""

from __future__ import annotations

import json
import struct
import sys
import threading
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "src")]

from muros.rtc.codes import ReturnCode  # noqa: E402
from muros.rtc.corba import data_type_of, start_orb  # noqa: E402
from muros.rtc.corba._setup import set_up  # noqa: E402
from muros.rtc.data import ConnectorInfo, DataEvent, DataInPort  # noqa: E402
from muros.rtc.profiles import ConnectorProfile  # noqa: E402

TYPES = {"TimedLong": "RTC::TimedLong", "64 KiB": "RTC::TimedOctetSeq"}
STAMP = struct.Struct("<II")


class Arrivals:
    """When values came, against when they were written; the stamp in them is of the monotonic clock."""

    def __init__(self) -> None:
        self.delays: list[int] = []
        self.count = 0
        self.changed = threading.Condition()

    def stamped(self, sec: int, nsec: int) -> None:
        """One came."""
        delay = time.monotonic_ns() - sec * 1_000_000_000 - nsec
        with self.changed:
            self.delays.append(delay)
            self.count += 1
            self.changed.notify_all()

    def counted(self) -> None:
        """One came, without looking at it."""
        self.count += 1

    def take(self) -> dict[str, Any]:
        """What came since the last time."""
        with self.changed:
            taken = {"count": self.count, "delays": self.delays}
            self.count, self.delays = 0, []
        return taken

    def wait(self, count: int, seconds: float = 20.0) -> None:
        """Until so many have come."""
        with self.changed:
            if not self.changed.wait_for(lambda: self.count >= count, seconds):
                raise TimeoutError(f"{self.count} of {count} values came")


class Receiver:
    """All that receives in one process."""

    def __init__(self) -> None:
        from muros.rtc.corba._stubs import OpenRTM, OpenRTM__POA

        self.orb = start_orb("127.0.0.1:")
        set_up(self.orb)
        self.arrivals = Arrivals()
        arrivals = self.arrivals
        self.looks = True
        receiver = self

        class Plain(OpenRTM__POA.InPortCdr):  # type: ignore[misc]
            """The floor: what omniORB itself takes."""

            def put(self, data: bytes) -> Any:
                if receiver.looks:
                    arrivals.stamped(*STAMP.unpack_from(data))
                else:
                    arrivals.counted()
                return OpenRTM.PORT_OK

        self.plain = self.orb.activate(Plain())
        self.ports = {name: DataInPort(f"in {name}", data_type_of(kind)) for name, kind in TYPES.items()}

    def _came(self, info: ConnectorInfo, value: Any) -> None:
        self.arrivals.stamped(value.tm.sec, value.tm.nsec)

    def floor(self) -> str:
        """The plain servant's reference."""
        return self.orb.to_text(self.plain)

    def look(self, looks: bool) -> None:
        """Whether arrivals are stamped one by one, or only counted."""
        self.looks = looks
        for port in self.ports.values():
            port.remove_listener(DataEvent.ON_RECEIVED, self._came)
            if looks:
                port.add_listener(DataEvent.ON_RECEIVED, self._came)

    def connect(self, size: str, properties: dict[str, str]) -> dict[str, str]:
        """The InPort alone; where it is to be found."""
        port = self.ports[size]
        code, profile = port.connect(ConnectorProfile("bench", "", (port,), properties))
        if code is not ReturnCode.RTC_OK:
            raise RuntimeError(code.name)
        return {key: text for key, text in profile.properties.items() if isinstance(text, str)}

    def disconnect(self) -> None:
        """All ports."""
        for port in self.ports.values():
            port.disconnect_all()

    def take(self) -> dict[str, Any]:
        """What came since the last time."""
        return self.arrivals.take()

    def wait(self, count: int) -> None:
        """Until so many have come."""
        self.arrivals.wait(count)


def main() -> None:
    receiver = Receiver()
    print(json.dumps({"result": receiver.floor()}), flush=True)
    for line in sys.stdin:
        command = json.loads(line)
        what = command.pop("do")
        print(json.dumps({"result": getattr(receiver, what)(**command)}), flush=True)
    sys.stdout.flush()
    receiver.orb.shutdown()


if __name__ == "__main__":
    main()
