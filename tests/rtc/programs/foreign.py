# mypy: ignore-errors
"""A component written on the RTC world's stubs alone: the peer that shows whether ours speaks what it should.

    python foreign.py HOST:PORT-OF-THE-NAME-SERVER NAME

It has an InPort `in` and an OutPort `out` of TimedLong, push only, and binds NAME.rtc. Each line of its standard input
is a whole number that it writes to `out`; each value that arrives at `in`, each call of an action, goes to its standard
output as a line. It ends with its input.
"""

import sys
import uuid

import CosNaming
import omniORB
from omniORB import CORBA
from omniORB import any as any_values
from rtctree.rtc import RTC, RTC__POA, OpenRTM, OpenRTM__POA, SDOPackage

ORB = CORBA.ORB_init(["foreign", "-ORBendPoint", "giop:tcp:127.0.0.1:"], CORBA.ORB_ID)
TYPECODE = CORBA.TypeCode(CORBA.id(RTC.TimedLong))


def say(*words):
    print(*words, flush=True)


def named_values(**values):
    return [
        SDOPackage.NameValue(key.replace("__", "."), any_values.to_any(value))
        for key, value in values.items()
    ]


class InPortCdr(OpenRTM__POA.InPortCdr):
    def put(self, data):
        say("value", omniORB.cdrUnmarshal(TYPECODE, data, 1).data)
        return OpenRTM.PORT_OK


class Port(RTC__POA.PortService):
    def __init__(self, owner, name, kind):
        self.owner, self.name, self.kind = owner, name, kind
        self.profiles, self.targets, self.inlet = {}, {}, InPortCdr()

    def get_port_profile(self):
        properties = named_values(
            port__port_type=self.kind,
            dataport__data_type="IDL:RTC/TimedLong:1.0",
            dataport__subscription_type="Any" if self.kind == "DataInPort" else "flush,new,periodic",
            dataport__interface_type="corba_cdr",
            dataport__dataflow_type="push",
        )
        name = f"{self.owner.name}.{self.name}"
        return RTC.PortProfile(
            name, [], self._this(), list(self.profiles.values()), self.owner._this(), properties
        )

    def get_connector_profiles(self):
        return list(self.profiles.values())

    def get_connector_profile(self, id):
        return self.profiles.get(id, RTC.ConnectorProfile("", "", [], []))

    def connect(self, profile):
        profile.connector_id = profile.connector_id or str(uuid.uuid4())
        return profile.ports[0].notify_connect(profile)

    def notify_connect(self, profile):
        if self.kind == "DataInPort":
            ior = ORB.object_to_string(self.inlet._this())
            profile.properties += named_values(dataport__corba_cdr__inport_ior=ior)
        code, profile = self.call_next(profile, "notify_connect", profile, otherwise=(RTC.RTC_OK, profile))
        if code == RTC.RTC_OK and self.kind == "DataOutPort":
            iors = [
                one.value.value() for one in profile.properties if one.name == "dataport.corba_cdr.inport_ior"
            ]
            self.targets[profile.connector_id] = ORB.string_to_object(iors[0])._narrow(OpenRTM.InPortCdr)
        if code == RTC.RTC_OK:
            self.profiles[profile.connector_id] = profile
        return code, profile

    def disconnect(self, id):
        known = self.profiles.get(id)
        return known.ports[0].notify_disconnect(id) if known else RTC.BAD_PARAMETER

    def notify_disconnect(self, id):
        known = self.profiles.pop(id, None)
        self.targets.pop(id, None)
        return (
            self.call_next(known, "notify_disconnect", id, otherwise=RTC.RTC_OK)
            if known
            else RTC.BAD_PARAMETER
        )

    def call_next(self, profile, operation, argument, otherwise):
        own = self._this()
        place = [port._is_equivalent(own) for port in profile.ports].index(True) + 1
        return getattr(profile.ports[place], operation)(argument) if place < len(profile.ports) else otherwise

    def write(self, number):
        for target in self.targets.values():
            octets = omniORB.cdrMarshal(TYPECODE, RTC.TimedLong(RTC.Time(0, 0), number), 1)
            say("status", target.put(octets))


class Component(OpenRTM__POA.DataFlowComponent):
    def __init__(self, name):
        self.name, self.contexts = name, {}
        self.ports = [Port(self, "in", "DataInPort"), Port(self, "out", "DataOutPort")]

    def get_component_profile(self):
        ports = [port.get_port_profile() for port in self.ports]
        return RTC.ComponentProfile(self.name, "Foreign", "", "1", "nobody", "test", ports, None, [])

    def get_ports(self):
        return [port._this() for port in self.ports]

    def get_owned_contexts(self):
        return []

    def get_participating_contexts(self):
        return list(self.contexts.values())

    def attach_context(self, context):
        self.contexts[1000 + len(self.contexts)] = context
        return max(self.contexts)

    def detach_context(self, handle):
        say("detach_context", handle)
        return RTC.RTC_OK if self.contexts.pop(handle, None) else RTC.BAD_PARAMETER

    def is_alive(self, context):
        return any(context._is_equivalent(one) for one in self.contexts.values())

    def __getattr__(self, name):
        if not name.startswith("on_"):
            raise AttributeError(name)
        return lambda *handle: say(name, *handle) or RTC.RTC_OK


def main(server, name):
    poa = ORB.resolve_initial_references("RootPOA")
    poa._get_the_POAManager().activate()
    component = Component(name)
    root = ORB.string_to_object(f"corbaloc::{server}/NameService")._narrow(CosNaming.NamingContext)
    root.rebind([CosNaming.NameComponent(name, "rtc")], component._this())
    say("ready")
    for line in sys.stdin:
        component.ports[1].write(int(line))
    ORB.destroy()


if __name__ == "__main__":
    main(*sys.argv[1:])
