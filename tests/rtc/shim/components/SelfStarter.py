#!/usr/bin/env python
# ruff: noqa
# mypy: ignore-errors
"""Makes itself active, sends to itself and calls slow functions, in the style of OpenRTM-aist-Python 2."""

import sys
import threading

import OpenRTM_aist
import OpenRTM_aist.StringUtil
import RTC

selfstarter_spec = [
    "implementation_id",
    "SelfStarter",
    "type_name",
    "SelfStarter",
    "category",
    "example",
    "language",
    "Python",
    "lang_type",
    "script",
    "conf.default.size",
    "2",
    "conf.more.size",
    "3",
    "",
]


class DataListener(OpenRTM_aist.ConnectorDataListenerT):
    def __init__(self, name):
        self._name = name

    def __call__(self, info, data):
        print(self._name, info.name, data.data, flush=True)
        data.data += 100
        return OpenRTM_aist.ConnectorListenerStatus.DATA_CHANGED, data


class SlowFunction:
    def __init__(self, result):
        self._result = result

    def __call__(self, obj):
        self._result[0] = obj.getInstanceName()


def sizes(value, text):
    return OpenRTM_aist.StringUtil.stringTo(0, text)


class SelfStarter(OpenRTM_aist.DataFlowComponentBase):
    def __init__(self, manager):
        OpenRTM_aist.DataFlowComponentBase.__init__(self, manager)
        self._mutex = threading.Lock()
        self._result = [None]
        self._async = None

    def onInitialize(self):
        self._size = [0]
        self.bindParameter("size", self._size, "2", sizes)
        self._data = RTC.TimedLong(RTC.Time(0, 0), 0)
        self._outport = OpenRTM_aist.OutPort("out", self._data)
        self.addOutPort("out", self._outport)
        self._inport = OpenRTM_aist.InPort("in", RTC.TimedLong(RTC.Time(0, 0), 0))
        self.addInPort("in", self._inport)
        self._outport.addConnectorDataListener(
            OpenRTM_aist.ConnectorDataListenerType.ON_SEND, DataListener("listener")
        )
        return RTC.RTC_OK

    def onActivated(self, ec_id):
        guard = OpenRTM_aist.ScopedLock(self._mutex)
        print("active set", self._configsets.getActiveId(), self._size[0], flush=True)
        del guard
        self._data.data = 5
        print("written", self._outport.write(), len(self._outport.get_connector_profiles()), flush=True)
        self._async = OpenRTM_aist.Async_tInvoker(self, SlowFunction(self._result))
        self._async.invoke()
        return RTC.RTC_OK

    def onExecute(self, ec_id):
        guard = OpenRTM_aist.ScopedLock(self._mutex)
        if self._inport.isNew():
            print("received", self._inport.read().data, flush=True)
        if self._async and self._async.finished():
            print("finished", self._result[0], flush=True)
            self._async = None
        return RTC.RTC_OK


def SelfStarterInit(manager):
    profile = OpenRTM_aist.Properties(defaults_str=selfstarter_spec)
    manager.registerFactory(profile, SelfStarter, OpenRTM_aist.Delete)


def MyModuleInit(manager):
    SelfStarterInit(manager)
    comp = manager.createComponent("SelfStarter")

    # Connect and activate
    prop = OpenRTM_aist.Properties()
    OpenRTM_aist.CORBA_RTCUtil.connect("loop", prop, comp._outport.getPortRef(), comp._inport.getPortRef())
    poa = manager.getPOA()
    obj = comp._default_POA().servant_to_reference(comp)
    print("same", obj._is_equivalent(poa.servant_to_reference(comp)), flush=True)
    rtobj = obj._narrow(RTC.RTObject)
    rtobj.get_owned_contexts()[0].activate_component(rtobj)


def main():
    mgr = OpenRTM_aist.Manager.init(sys.argv)
    mgr.setModuleInitProc(MyModuleInit)
    mgr.activateManager()
    mgr.runManager()


if __name__ == "__main__":
    main()
