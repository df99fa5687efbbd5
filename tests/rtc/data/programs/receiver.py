"""An InPort in a process of its own, connected alone: prints where it is to be found, then every value that comes.

Arguments: the connection's properties, as KEY=VALUE. Ends when its standard input does.
"""

import json
import sys
import threading

from muros.rtc.codes import ReturnCode
from muros.rtc.corba import data_type_of, start_orb
from muros.rtc.corba._setup import set_up
from muros.rtc.data import ConnectorInfo, DataEvent, DataInPort
from muros.rtc.profiles import ConnectorProfile

PRINTING = threading.Lock()


def tell(info: ConnectorInfo, value: object) -> None:
    """One has come."""
    with PRINTING:
        print(value.data, flush=True)  # type: ignore[attr-defined]


def main() -> None:
    orb = start_orb("127.0.0.1:")
    set_up(orb)
    port = DataInPort("in", data_type_of("RTC::TimedLong"))
    port.add_listener(DataEvent.ON_RECEIVED, tell)
    properties = dict(argument.split("=", 1) for argument in sys.argv[1:])
    code, profile = port.connect(ConnectorProfile("across", "", (port,), properties))
    assert code is ReturnCode.RTC_OK
    print(
        json.dumps({key: one for key, one in profile.properties.items() if isinstance(one, str)}), flush=True
    )
    sys.stdin.read()
    port.disconnect_all()
    orb.shutdown()


if __name__ == "__main__":
    main()
