# mypy: ignore-errors
"""Two service ports written on the RTC world's stubs alone: no code of muros.

python foreign.py Greeter.idl
Prints the references of its provider's port and of its consumer's, then obeys lines: `call NAME` calls whoever its
consumer has found, `connect IOR IOR STRICT` asks the first of two ports to connect both, `deaf` leaves the process.
"""

import os
import sys

import omniORB
from omniORB import CORBA
from omniORB import any as any_
from rtctree.rtc import RTC, RTC__POA, SDOPackage

omniORB.importIDL(sys.argv[1])

import Greetings  # noqa: E402
import Greetings__POA  # noqa: E402

orb = CORBA.ORB_init(["foreign", "-ORBendPoint", "giop:tcp:127.0.0.1:"], CORBA.ORB_ID)
poa = orb.resolve_initial_references("RootPOA")
poa._get_the_POAManager().activate()


class Greeter(Greetings__POA.Greeter):
    volume = 1

    def greet(self, name):
        if name == "nobody":
            raise Greetings.Refused("foreign")
        return f"foreign greets {name}"

    def _get_volume(self):
        return self.volume

    def _set_volume(self, volume):
        self.volume = volume


class Port(RTC__POA.PortService):
    """A port that negotiates as OpenRTM-aist's do."""

    def __init__(self, name, polarity):
        self.name, self.polarity, self.found, self.standing = name, polarity, None, {}

    def get_port_profile(self):
        interface = RTC.PortInterfaceProfile("one", "Greeter", self.polarity)
        return RTC.PortProfile(f"Foreign0.{self.name}", [interface], self._this(), [], None, [])

    def get_connector_profiles(self):
        return list(self.standing.values())

    def get_connector_profile(self, connector_id):
        return self.standing[connector_id]

    def connect(self, profile):
        if not profile.connector_id:
            profile.connector_id = "foreign-id"
        return profile.ports[0].notify_connect(profile)

    def notify_connect(self, profile):
        self.publish(profile)
        code = RTC.RTC_OK
        after = self.next(profile)
        if after is not None:
            code, profile = after.notify_connect(profile)
        if code == RTC.RTC_OK:
            code = self.subscribe(profile)
        self.standing[profile.connector_id] = profile
        return code, profile

    def next(self, profile):
        places = [p for p, port in enumerate(profile.ports) if port._is_equivalent(self._this())]
        place = places[0] + 1
        return profile.ports[place] if place < len(profile.ports) else None

    def publish(self, profile):
        if self.polarity == RTC.PROVIDED:
            text = any_.to_any(orb.object_to_string(greeter._this()))
            key = f"Foreign0.port.{self.name}.provided.Greeter.one"
            profile.properties.append(SDOPackage.NameValue(key, text))
            profile.properties.append(SDOPackage.NameValue("port.Greeter.one", text))

    def subscribe(self, profile):
        if self.polarity == RTC.PROVIDED:
            return RTC.RTC_OK
        texts = {one.name: any_.from_any(one.value) for one in profile.properties}
        if "port.Greeter.one" not in texts:
            return RTC.RTC_ERROR if texts.get("port.connection.strictness") == "strict" else RTC.RTC_OK
        self.found = orb.string_to_object(texts["port.Greeter.one"])._narrow(Greetings.Greeter)
        return RTC.RTC_OK

    def disconnect(self, connector_id):
        return self.standing[connector_id].ports[0].notify_disconnect(connector_id)

    def notify_disconnect(self, connector_id):
        profile = self.standing.pop(connector_id, None)
        if profile is None:
            return RTC.BAD_PARAMETER
        after = self.next(profile)
        if after is not None:
            after.notify_disconnect(connector_id)
        self.found = None
        return RTC.RTC_OK

    def disconnect_all(self):
        for connector_id in list(self.standing):
            self.disconnect(connector_id)
        return RTC.RTC_OK


greeter = Greeter()
provider, consumer = Port("p", RTC.PROVIDED), Port("c", RTC.REQUIRED)
print(orb.object_to_string(provider._this()), orb.object_to_string(consumer._this()), flush=True)
for line in sys.stdin:
    word, *words = line.split()
    if word == "call":
        try:
            print(consumer.found.greet(words[0]) if consumer.found else "nobody found", flush=True)
        except Greetings.Refused as error:
            print("refused:", error.why, flush=True)
        except CORBA.OBJECT_NOT_EXIST:
            print("not active", flush=True)
    elif word == "connect":
        ports = [orb.string_to_object(word)._narrow(RTC.PortService) for word in words[:2]]
        strict = SDOPackage.NameValue("port.connection.strictness", any_.to_any(words[2]))
        code, _ = ports[0].connect(RTC.ConnectorProfile("wire", "", ports, [strict]))
        print(code, len(provider.standing), len(consumer.standing), flush=True)
    else:
        os._exit(0)
