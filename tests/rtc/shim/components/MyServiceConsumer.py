#!/usr/bin/env python
# ruff: noqa
# mypy: ignore-errors
"""Calls a service, in the style of OpenRTM-aist-Python."""

import sys

import RTC
import SimpleService
import OpenRTM_aist
from omniORB import CORBA

myserviceconsumer_spec = [
    "implementation_id",
    "MyServiceConsumer",
    "type_name",
    "MyServiceConsumer",
    "description",
    "MyService Consumer Sample component",
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


class MyServiceConsumer(OpenRTM_aist.DataFlowComponentBase):
    def onInitialize(self):
        self._myServicePort = OpenRTM_aist.CorbaPort("MyService")
        self._myservice0 = OpenRTM_aist.CorbaConsumer(interfaceType=SimpleService.MyService)
        self._myServicePort.registerConsumer("myservice0", "MyService", self._myservice0)
        self.addPort(self._myServicePort)
        self._count = 0
        return RTC.RTC_OK

    def onExecute(self, ec_id):
        if CORBA.is_nil(self._myservice0._ptr()) or self._count == 3:
            return RTC.RTC_OK
        self._count += 1
        try:
            self._myservice0._ptr().set_value(self._count / 2)
            print(
                "echo",
                self._myservice0._ptr().echo("call %d" % self._count),
                self._myservice0._ptr().get_value(),
                flush=True,
            )
        except CORBA.OBJECT_NOT_EXIST:
            self._count -= 1
        if self._count == 3:
            print(
                "history",
                self._myservice0._ptr().get_echo_history(),
                self._myservice0._ptr().get_value_history(),
                flush=True,
            )
        return RTC.RTC_OK


def MyServiceConsumerInit(manager):
    profile = OpenRTM_aist.Properties(defaults_str=myserviceconsumer_spec)
    manager.registerFactory(profile, MyServiceConsumer, OpenRTM_aist.Delete)


def MyModuleInit(manager):
    MyServiceConsumerInit(manager)
    manager.createComponent("MyServiceConsumer")


def main():
    mgr = OpenRTM_aist.Manager.init(sys.argv)
    mgr.setModuleInitProc(MyModuleInit)
    mgr.activateManager()
    mgr.runManager()


if __name__ == "__main__":
    main()
