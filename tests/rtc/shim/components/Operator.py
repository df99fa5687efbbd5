#!/usr/bin/env python
# ruff: noqa
# mypy: ignore-errors
"""Finds components by their addresses and works them, in the style of programs for OpenRTM-aist-Python 2."""

import sys

import OpenRTM_aist
import OpenRTM_aist.CORBA_RTCUtil
from omniORB import CORBA

NAMES = sys.argv.pop()


def say(*words):
    print(*words, flush=True)


def find(naming, name):
    found = naming.string_to_component("rtcname://%s/*/%s" % (NAMES, name))
    if not found:
        say("Could not find", name)
        sys.exit(1)
    return found[0]


def main():
    mgr = OpenRTM_aist.Manager.init(sys.argv)
    mgr.activateManager()
    mgr.runManager(True)
    util = OpenRTM_aist.CORBA_RTCUtil

    nm = OpenRTM_aist.Manager.instance().getNaming()
    consolein = find(nm, "ConsoleIn0")
    consoleout = find(nm, "ConsoleOut0")
    configsample = find(nm, "ConfigSample0")
    provider = find(nm, "MyServiceProvider0")
    say("nowhere", nm.string_to_component("rtcname://%s/*/Nobody0" % NAMES))

    url = "rtcname://%s/*/ConsoleOut0.in" % NAMES
    port_in = OpenRTM_aist.CORBA_RTCUtil.get_port_by_url(url)
    port_out = util.get_port_by_name(consolein, "ConsoleIn0.out")
    say("ports", CORBA.is_nil(port_in), CORBA.is_nil(port_out))

    prop = OpenRTM_aist.Properties()
    prop.setProperty("dataport.dataflow_type", "push")
    prop.setProperty("dataport.interface_type", "corba_cdr")
    prop.setProperty("dataport.subscription_type", "new")
    say("connect", util.connect("first", prop, port_in, port_out))
    say("names", util.get_connector_names_by_portref(port_in))
    say("names", util.get_connector_names(consolein, "ConsoleIn0.out"))
    say("joined", util.already_connected(port_in, port_out))
    say("again", util.connect_multi("second", prop, port_in, [port_out]))
    say("end", util.disconnect_by_portref_connector_name(port_in, "first"))
    say("multi", util.connect_multi("second", prop, port_in, [port_out]))
    say("end", util.disconnect_by_portname_connector_name(url, "second"))
    say("by name", util.connect_by_name("third", prop, consoleout, "ConsoleOut0.in", consolein, "out"))

    say("activate", util.activate(consoleout, 0))
    ret, state = util.get_state(consoleout, 0)
    say("state", ret, state, util.is_in_active(consoleout), util.is_in_inactive(consoleout))
    say("deactivate", util.deactivate(consoleout, 0), util.reset(consoleout, 0))
    util.set_default_rate(consoleout, 20.0)
    say("rate", util.get_default_rate(consoleout))
    util.set_current_rate(consoleout, 0, 50.0)
    say("rate", util.get_current_rate(consoleout, 0))

    say("attach", util.add_rtc_to_default_ec(consoleout, consolein))
    for i, rtc in enumerate(util.get_participants_rtc(consoleout)):
        say("participant", i, util.get_component_profile(rtc).getProperty("instance_name"))
    say("detach", util.remove_rtc_to_default_ec(consoleout, consolein), util.get_participants_rtc(consoleout))

    say("set", util.set_active_configuration(configsample, "int_param0", "7"))
    say("set", util.set_configuration(configsample, "mode1", "str_param0", "test"))
    say("set", util.set_configuration(configsample, "no such mode", "str_param0", "test"))
    say("active", util.get_active_configuration_name(configsample))
    say(util.get_active_configuration(configsample))
    say("default", util.get_configuration(configsample, "default").getProperty("int_param0"))
    say("key", util.get_parameter_by_key(configsample, "mode1", "int_param0"))

    say("in", util.get_inport_names(consoleout), "out", util.get_outport_names(consolein))
    say("service", util.get_svcport_names(provider), "all", util.get_port_names(provider))
    say("all gone", util.disconnect_all_by_name("rtcname://%s/*/ConsoleIn0.out" % NAMES))
    say("names", util.get_connector_names_by_portref(port_in))
    mgr.shutdown()


if __name__ == "__main__":
    main()
