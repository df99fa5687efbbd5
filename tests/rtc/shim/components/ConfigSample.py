#!/usr/bin/env python
# ruff: noqa
# mypy: ignore-errors
"""Parameters of several kinds, in the style of OpenRTM-aist-Python."""

import sys

import OpenRTM_aist
import RTC

configsample_spec = [
    "implementation_id",
    "ConfigSample",
    "type_name",
    "ConfigSample",
    "description",
    "Configuration example component",
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
    "conf.default.int_param0",
    "0",
    "conf.default.double_param0",
    "0.11",
    "conf.default.str_param0",
    "hoge",
    "conf.default.vector_param0",
    "0.0,1.0,2.0",
    "conf.mode1.int_param0",
    "12345",
    "conf.__widget__.int_param0",
    "spin",
    "conf.__constraints__.int_param0",
    "0<=x<=100000",
    "",
]


class ParamListener(OpenRTM_aist.ConfigurationParamListener):
    def __call__(self, name, value):
        print("parameter", name, value, flush=True)


class ConfigSample(OpenRTM_aist.DataFlowComponentBase):
    def __init__(self, manager):
        OpenRTM_aist.DataFlowComponentBase.__init__(self, manager)
        self._int_param0 = [0]
        self._double_param0 = [0.0]
        self._str_param0 = [""]
        self._vector_param0 = [[0.0]]
        self._hex = [0]

    def onInitialize(self):
        self.bindParameter("int_param0", self._int_param0, "0")
        self.bindParameter("double_param0", self._double_param0, "0.11")
        self.bindParameter("str_param0", self._str_param0, "hoge")
        self.bindParameter("vector_param0", self._vector_param0, "0.0,1.0,2.0")
        self.bindParameter("hex", self._hex, "ff", self.from_hex)
        self.addConfigurationParamListener(
            OpenRTM_aist.ConfigurationParamListenerType.ON_UPDATE_CONFIG_PARAM, ParamListener()
        )
        return RTC.RTC_OK

    def from_hex(self, var, text):
        try:
            var[0] = int(text, 16)
        except ValueError:
            return False
        return True

    def onExecute(self, ec_id):
        now = (
            self._int_param0[0],
            self._double_param0[0],
            self._str_param0[0],
            self._vector_param0[0],
            self._hex[0],
        )
        if now != getattr(self, "_before", None):
            print("values", *now, flush=True)
            self._before = now
        return RTC.RTC_OK


def ConfigSampleInit(manager):
    profile = OpenRTM_aist.Properties(defaults_str=configsample_spec)
    manager.registerFactory(profile, ConfigSample, OpenRTM_aist.Delete)


def MyModuleInit(manager):
    ConfigSampleInit(manager)
    manager.createComponent("ConfigSample")


def main():
    mgr = OpenRTM_aist.Manager.init(sys.argv)
    mgr.setModuleInitProc(MyModuleInit)
    mgr.activateManager()
    mgr.runManager()


if __name__ == "__main__":
    main()
