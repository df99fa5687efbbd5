#!/usr/bin/env python
# ruff: noqa
# mypy: ignore-errors
"""Connects two components without a manager, in the style of programs for OpenRTM-aist-Python 1."""

import sys

from omniORB import CORBA

import OpenRTM_aist
import RTC

NAMES = sys.argv.pop()


def main():
    orb = CORBA.ORB_init(sys.argv)
    naming = OpenRTM_aist.CorbaNaming(orb, NAMES)
    conin = OpenRTM_aist.CorbaConsumer()
    conout = OpenRTM_aist.CorbaConsumer()

    conin.setObject(naming.resolve("ConsoleIn0.rtc"))
    inobj = conin.getObject()._narrow(RTC.RTObject)
    pin = inobj.get_ports()
    pin[0].disconnect_all()

    conout.setObject(naming.resolve("ConsoleOut0.rtc"))
    outobj = conout.getObject()._narrow(RTC.RTObject)
    pout = outobj.get_ports()
    pout[0].disconnect_all()

    push_policy = OpenRTM_aist.normalize([" NEW "])
    conprof = RTC.ConnectorProfile("connector0", "", [pin[0], pout[0]], [])
    for name, value in (
        ("dataport.interface_type", "corba_cdr"),
        ("dataport.dataflow_type", "push"),
        ("dataport.subscription_type", "flush"),
        ("dataport.publisher.push_policy", push_policy),
    ):
        OpenRTM_aist.CORBA_SeqUtil.push_back(conprof.properties, OpenRTM_aist.NVUtil.newNV(name, value))
    ret, conprof = pin[0].connect(conprof)
    print("connected", ret, OpenRTM_aist.NVUtil.toString(conprof.properties, "dataport.subscription_type"))

    for rtobj in (inobj, outobj):
        rtobj.get_owned_contexts()[0].activate_component(rtobj)


if __name__ == "__main__":
    main()
