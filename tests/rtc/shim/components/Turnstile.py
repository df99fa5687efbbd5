#!/usr/bin/env python
# ruff: noqa
# mypy: ignore-errors
"""A state machine with an event port, in the style of OpenRTM-aist-Python."""

import sys

import RTC
import OpenRTM_aist
import OpenRTM_aist.EventPort as EventPort
import OpenRTM_aist.StaticFSM as StaticFSM

turnstile_spec = [
    "implementation_id",
    "Turnstile",
    "type_name",
    "Turnstile",
    "description",
    "A state machine",
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


@StaticFSM.FSM_TOPSTATE
class Top(StaticFSM.Link):
    class Data:
        def __init__(self):
            self.cents = 0

    def onInit(self):
        self.set_state(StaticFSM.State(Locked))
        return RTC.RTC_OK

    def coin(self, value):
        pass

    def push(self):
        pass


@StaticFSM.FSM_SUBSTATE(Top)
class Locked(StaticFSM.Link):
    def onEntry(self):
        print("locked", flush=True)
        return RTC.RTC_OK

    def coin(self, value):
        self.data(Top).cents += value.data
        if self.data(Top).cents >= 50:
            self.set_state(StaticFSM.State(Unlocked))


@StaticFSM.FSM_SUBSTATE(Top)
class Unlocked(StaticFSM.Link):
    def onEntry(self):
        print("unlocked with", self.data(Top).cents, flush=True)
        return RTC.RTC_OK

    def push(self):
        self.data(Top).cents = 0
        self.set_state(StaticFSM.State(Locked))


class Turnstile(OpenRTM_aist.DataFlowComponentBase):
    def onInitialize(self):
        self._fsm = StaticFSM.Machine(Top, self)
        self._eventIn = EventPort.EventInPort("event", self._fsm)
        self.addInPort("event", self._eventIn)
        self._eventIn.bindEvent1("coin", Top.coin, RTC.TimedLong(RTC.Time(0, 0), 0))
        self._eventIn.bindEvent0("push", Top.push)
        return RTC.RTC_OK

    def onFinalize(self):
        self._fsm.shutdown()
        print("finalized", flush=True)
        return RTC.RTC_OK

    def onExecute(self, ec_id):
        self._fsm.run_event()
        return RTC.RTC_OK


def TurnstileInit(manager):
    profile = OpenRTM_aist.Properties(defaults_str=turnstile_spec)
    manager.registerFactory(profile, Turnstile, OpenRTM_aist.Delete)


def MyModuleInit(manager):
    TurnstileInit(manager)
    manager.createComponent("Turnstile")


def main():
    mgr = OpenRTM_aist.Manager.init(sys.argv)
    mgr.setModuleInitProc(MyModuleInit)
    mgr.activateManager()
    mgr.runManager()


if __name__ == "__main__":
    main()
