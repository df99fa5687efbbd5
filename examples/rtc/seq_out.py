"""Values and sequences of five types, new ones in each cycle."""

import random

import RTC
from muros.rtc import Component, OutPort, Parameter, run


class SeqOut(Component):
    """Sequence OutPort component"""

    type_name = "SequenceOutComponent"
    version = "1.0"
    category = "example"
    max_instance = 10
    rate = 10
    specification = {"implementation_id": "SeqOut"}

    octet = OutPort(RTC.TimedOctet, name="Octet")
    short = OutPort(RTC.TimedShort, name="Short")
    long = OutPort(RTC.TimedLong, name="Long")
    float_ = OutPort(RTC.TimedFloat, name="Float")
    double = OutPort(RTC.TimedDouble, name="Double")
    octets = OutPort(RTC.TimedOctetSeq, name="OctetSeq")
    shorts = OutPort(RTC.TimedShortSeq, name="ShortSeq")
    longs = OutPort(RTC.TimedLongSeq, name="LongSeq")
    floats = OutPort(RTC.TimedFloatSeq, name="FloatSeq")
    doubles = OutPort(RTC.TimedDoubleSeq, name="DoubleSeq")

    length = Parameter(10, constraint="0<=x<=1000", widget="spin")

    def on_execute(self, context: int) -> None:
        count = range(self.length)
        self.octet.write(random.randrange(256))
        self.short.write(random.randrange(-(2**15), 2**15))
        self.long.write(random.randrange(-(2**31), 2**31))
        self.float_.write(random.random())
        self.double.write(random.random())
        self.octets.write(random.randbytes(self.length))
        self.shorts.write([random.randrange(-(2**15), 2**15) for _ in count])
        self.longs.write([random.randrange(-(2**31), 2**31) for _ in count])
        self.floats.write([random.random() for _ in count])
        self.doubles.write([random.random() for _ in count])


if __name__ == "__main__":
    run(SeqOut)
