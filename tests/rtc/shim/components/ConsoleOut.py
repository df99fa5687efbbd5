#!/usr/bin/env python
# ruff: noqa
# mypy: ignore-errors
"""Prints the numbers that come, in the style of OpenRTM-aist-Python."""

import sys

sys.path.append(".")

import RTC
import OpenRTM_aist

consoleout_spec = [
    "implementation_id",
    "ConsoleOut",
    "type_name",
    "ConsoleOut",
    "description",
    "Numbers to the console",
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


class Doubled(OpenRTM_aist.OnReadConvert):
    def __call__(self, value):
        value.data *= 2
        return value


class ConsoleOut(OpenRTM_aist.DataFlowComponentBase):
    def __init__(self, manager):
        OpenRTM_aist.DataFlowComponentBase.__init__(self, manager)
        self._data = RTC.TimedLong(RTC.Time(0, 0), 0)
        self._inport = OpenRTM_aist.InPort("in", self._data)

    def onInitialize(self):
        self.registerInPort("in", self._inport)
        self._inport.setOnReadConvert(Doubled())
        self.addPreComponentActionListener(
            OpenRTM_aist.PreComponentActionListenerType.PRE_ON_ACTIVATED,
            lambda ec_id: print("before activation", ec_id, flush=True),
        )
        self._rtcout.RTC_INFO("%s is ready, %d", (self.getInstanceName(), 1))
        return RTC.RTC_OK

    def onActivated(self, ec_id):
        print("activated at", self.getExecutionRate(ec_id), flush=True)
        return RTC.RTC_OK

    def onExecute(self, ec_id):
        if self._inport.isNew():
            data = self._inport.read()
            print("Received:", data.data, "stamped", data.tm.sec > 0, flush=True)
        return RTC.RTC_OK


def ConsoleOutInit(manager):
    profile = OpenRTM_aist.Properties(defaults_str=consoleout_spec)
    manager.registerFactory(profile, ConsoleOut, OpenRTM_aist.Delete)


def MyModuleInit(manager):
    ConsoleOutInit(manager)

    # As templates have it: an instance name on the command line
    instance_name = [i for i in sys.argv if "--instance_name=" in i]
    args = instance_name[0].replace("--", "?") if instance_name else ""
    manager.createComponent("ConsoleOut" + args)


def main():
    argv = [i for i in sys.argv if not "--instance_name=" in i]
    mgr = OpenRTM_aist.Manager.init(len(argv), argv)
    mgr.setModuleInitProc(MyModuleInit)
    mgr.activateManager()
    mgr.runManager()


if __name__ == "__main__":
    main()
