"""Prints values and sequences of five types, each when it comes."""

import RTC
from muros.rtc import Component, DataInPort, InPort, run


class SeqIn(Component):
    """Sequence InPort component"""

    type_name = "SequenceInComponent"
    version = "1.0"
    category = "example"
    max_instance = 10
    rate = 100
    specification = {"implementation_id": "SeqIn"}

    octet = InPort(RTC.TimedOctet, name="Octet")
    short = InPort(RTC.TimedShort, name="Short")
    long = InPort(RTC.TimedLong, name="Long")
    float_ = InPort(RTC.TimedFloat, name="Float")
    double = InPort(RTC.TimedDouble, name="Double")
    octets = InPort(RTC.TimedOctetSeq, name="OctetSeq")
    shorts = InPort(RTC.TimedShortSeq, name="ShortSeq")
    longs = InPort(RTC.TimedLongSeq, name="LongSeq")
    floats = InPort(RTC.TimedFloatSeq, name="FloatSeq")
    doubles = InPort(RTC.TimedDoubleSeq, name="DoubleSeq")

    def on_execute(self, context: int) -> None:
        for port in self.ports:
            if isinstance(port, DataInPort) and port.is_new():
                print(f"{port.name}: {port.read().data}", flush=True)


if __name__ == "__main__":
    run(SeqIn)
