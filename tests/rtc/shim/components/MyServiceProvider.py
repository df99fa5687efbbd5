#!/usr/bin/env python
# ruff: noqa
# mypy: ignore-errors
"""Provides a service, in the style of OpenRTM-aist-Python."""

import sys

import RTC
import SimpleService
import SimpleService__POA
import OpenRTM_aist

myserviceprovider_spec = [
    "implementation_id",
    "MyServiceProvider",
    "type_name",
    "MyServiceProvider",
    "description",
    "MyService Provider Sample component",
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


class MyServiceSVC_impl(SimpleService__POA.MyService):
    def __init__(self):
        self._echo, self._values, self._value = [], [], 0.0

    def echo(self, msg):
        self._echo.append(msg)
        return msg

    def get_echo_history(self):
        return self._echo

    def set_value(self, value):
        self._value = value
        self._values.append(value)

    def get_value(self):
        return self._value

    def get_value_history(self):
        return self._values


class MyServiceProvider(OpenRTM_aist.DataFlowComponentBase):
    def onInitialize(self):
        self._myServicePort = OpenRTM_aist.CorbaPort("MyService")
        self._myservice0 = MyServiceSVC_impl()
        self._myServicePort.registerProvider("myservice0", "MyService", self._myservice0)
        self.addPort(self._myServicePort)
        return RTC.RTC_OK


def MyServiceProviderInit(manager):
    profile = OpenRTM_aist.Properties(defaults_str=myserviceprovider_spec)
    manager.registerFactory(profile, MyServiceProvider, OpenRTM_aist.Delete)


def MyModuleInit(manager):
    MyServiceProviderInit(manager)
    manager.createComponent("MyServiceProvider")


def main():
    mgr = OpenRTM_aist.Manager.init(sys.argv)
    mgr.setModuleInitProc(MyModuleInit)
    mgr.activateManager()
    mgr.runManager()


if __name__ == "__main__":
    main()
