#!/usr/bin/env python
# ruff: noqa
# mypy: ignore-errors
"""Sequences out and in, two components in one file, in the style of OpenRTM-aist-Python."""

import sys

import OpenRTM_aist
import RTC
from OpenRTM_aist import *


def spec(name):
    return [
        "implementation_id",
        name,
        "type_name",
        name,
        "description",
        "Sequences",
        "version",
        "1.0",
        "vendor",
        "muros",
        "category",
        "example",
        "activity_type",
        "DataFlowComponent",
        "max_instance",
        "10",
        "language",
        "Python",
        "lang_type",
        "script",
        "",
    ]


class SeqOut(DataFlowComponentBase):
    def __init__(self, manager):
        DataFlowComponentBase.__init__(self, manager)
        self._octets = RTC.TimedOctetSeq(RTC.Time(0, 0), [])
        self._long = RTC.TimedLongSeq(RTC.Time(0, 0), [])
        self._double = RTC.TimedDoubleSeq(RTC.Time(0, 0), [])
        self._text = RTC.TimedString(RTC.Time(0, 0), "")
        self._outs = [
            OutPort(name, value)
            for name, value in (
                ("Octet", self._octets),
                ("Long", self._long),
                ("Double", self._double),
                ("Text", self._text),
            )
        ]
        self._count = 0

    def onInitialize(self):
        for port in self._outs:
            self.addOutPort(port.name(), port)
        return RTC.RTC_OK

    def onExecute(self, ec_id):
        self._count += 1
        self._octets.data = bytes([self._count % 256] * 3)
        self._long.data = [self._count, -self._count]
        self._double.data = [self._count / 2]
        self._text.data = "number %d" % self._count
        for port in self._outs:
            port.write()
        return RTC.RTC_OK


class SeqIn(DataFlowComponentBase):
    def onInitialize(self):
        self._octets = RTC.TimedOctetSeq(RTC.Time(0, 0), [])
        self._long = RTC.TimedLongSeq(RTC.Time(0, 0), [])
        self._double = RTC.TimedDoubleSeq(RTC.Time(0, 0), [])
        self._text = RTC.TimedString(RTC.Time(0, 0), "")
        self._ins = [
            InPort(name, value)
            for name, value in (
                ("Octet", self._octets),
                ("Long", self._long),
                ("Double", self._double),
                ("Text", self._text),
            )
        ]
        for port in self._ins:
            self.addInPort(port.name(), port)
        return RTC.RTC_OK

    def onExecute(self, ec_id):
        if not all(port.isNew() for port in self._ins):
            return RTC.RTC_OK
        octets, long, double, text = [port.read().data for port in self._ins]
        print("got", list(octets), list(long), list(double), text, flush=True)
        return RTC.RTC_OK


def SeqIOInit(manager):
    for kind in (SeqOut, SeqIn):
        manager.registerFactory(Properties(defaults_str=spec(kind.__name__)), kind, Delete)


def MyModuleInit(manager):
    SeqIOInit(manager)
    for name in ("SeqOut", "SeqIn"):
        manager.createComponent(name)


def main():
    mgr = Manager.init(sys.argv)
    mgr.setModuleInitProc(MyModuleInit)
    if mgr.activateManager():
        mgr.runManager()


if __name__ == "__main__":
    main()
