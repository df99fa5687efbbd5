#!/usr/bin/env python
# ruff: noqa
# mypy: ignore-errors
"""Sends the numbers that are typed, in the style of OpenRTM-aist-Python."""

import sys

import RTC
import OpenRTM_aist

consolein_spec = [
    "implementation_id",
    "ConsoleIn",
    "type_name",
    "ConsoleIn",
    "description",
    "Numbers from the console",
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


class DataListener(OpenRTM_aist.ConnectorDataListenerT):
    def __init__(self, name):
        self._name = name

    def __call__(self, info, cdrdata):
        data = OpenRTM_aist.ConnectorDataListenerT.__call__(
            self, info, cdrdata, RTC.TimedLong(RTC.Time(0, 0), 0)
        )
        print("listener", self._name, info.name, data.data, flush=True)
        return OpenRTM_aist.ConnectorListenerStatus.NO_CHANGE


class ConnListener(OpenRTM_aist.ConnectorListener):
    def __init__(self, name):
        self._name = name

    def __call__(self, info):
        kind = info.properties.getProperty("dataflow_type")
        print("connector", self._name, info.name, kind, bool(info.id), flush=True)


class ConsoleIn(OpenRTM_aist.DataFlowComponentBase):
    def __init__(self, manager):
        OpenRTM_aist.DataFlowComponentBase.__init__(self, manager)

    def onInitialize(self):
        self._data = RTC.TimedLong(RTC.Time(0, 0), 0)
        self._outport = OpenRTM_aist.OutPort("out", self._data)
        self.addOutPort("out", self._outport)
        self._outport.addConnectorDataListener(
            OpenRTM_aist.ConnectorDataListenerType.ON_SEND, DataListener("ON_SEND")
        )
        self._outport.addConnectorListener(
            OpenRTM_aist.ConnectorListenerType.ON_CONNECT, ConnListener("ON_CONNECT")
        )
        self._outport.addConnectorListener(
            OpenRTM_aist.ConnectorListenerType.ON_DISCONNECT, ConnListener("ON_DISCONNECT")
        )
        return RTC.RTC_OK

    def onExecute(self, ec_id):
        line = sys.stdin.readline()
        if line.strip():
            self._data.data = int(line)
            OpenRTM_aist.setTimestamp(self._data)
            print("sent", self._outport.write(), flush=True)
        return RTC.RTC_OK


def ConsoleInInit(manager):
    profile = OpenRTM_aist.Properties(defaults_str=consolein_spec)
    manager.registerFactory(profile, ConsoleIn, OpenRTM_aist.Delete)


def MyModuleInit(manager):
    ConsoleInInit(manager)
    comp = manager.createComponent("ConsoleIn")
    print("made", comp.getInstanceName(), comp.getTypeName(), flush=True)


def main():
    mgr = OpenRTM_aist.Manager.init(sys.argv)
    mgr.setModuleInitProc(MyModuleInit)
    mgr.activateManager()
    mgr.runManager()


if __name__ == "__main__":
    main()
