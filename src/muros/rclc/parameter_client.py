"""Clients of other nodes' parameters.

    arm = ParameterClient(node, "/arm")
    arm.set("gain", 2.0)
    print(arm.get("gain"), arm.list())

Every method waits for the answer, at most ``timeout`` seconds, and raises a ParameterError for what went wrong. Within
an executor, where nothing may wait, give ``then``: a function that gets the answer, or the ParameterError in its place.
"""

from muros.compat import borrow, const, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from typing import Any

    from muros.rclc.client import Client
    from muros.rclc.context import Node
    from muros.rclc.memory import Rules

_TIMEOUT = const(5)  # seconds
_ATTEMPT = const(1)  # seconds that one question of ``wait`` waits for its answer


class ParameterClient:
    """Asks the node ``target``, named as topics are, from ``node``. On hosts it loads and dumps YAML, see there.

    Needs the types of rcl_interfaces, as parameters of our own do. ``memory`` bounds what its answers take, such as
    ``values.string_value`` or ``result.names``; one beyond it is none.
    """

    def __init__(
        self, node: "Node", target: str, timeout: float = _TIMEOUT, memory: "Rules | None" = None
    ) -> None:
        self.node = node
        self.memory = memory
        self.target = node._resolve(target)
        self.timeout = timeout
        self._clients: "dict[str, Client]" = {}

    def wait(self, timeout: float) -> bool:
        """Waits until the node answers, at most ``timeout`` seconds; whether it does."""
        from muros.rclc.parameter_errors import ParameterTimeoutError

        clock = self.node.context.clock
        start = clock()
        left = timeout
        while left > 0:
            try:
                self.list(timeout=min(left, _ATTEMPT))
                return True
            except ParameterTimeoutError:
                left = timeout - ticks_diff(clock(), start) / 1000
        return False

    def get(
        self, names: "Any", timeout: "float | None" = None, then: "Callable[[Any], object] | None" = None
    ) -> "Any":
        """The value of a parameter, or of several: a dictionary. ParameterNotDeclaredError if there is none."""
        wanted = [names] if isinstance(names, str) else list(names)
        request = self._kind("srv/GetParameters").Request()
        request.names = wanted
        take = borrow("muros.rclc.parameter_values").take

        def read(response: "Any") -> "Any":
            self._be_all(wanted, response.values)
            values = {wanted[i]: take(response.values[i]) for i in range(len(wanted))}
            return values[names] if isinstance(names, str) else values

        return self._ask("GetParameters", "get_parameters", request, read, timeout, then)

    def types(
        self,
        names: "Iterable[str]",
        timeout: "float | None" = None,
        then: "Callable[[Any], object] | None" = None,
    ) -> "Any":
        """The types of parameters, by name, as numbers. ParameterNotDeclaredError if one is not there."""
        wanted = list(names)
        request = self._kind("srv/GetParameterTypes").Request()
        request.names = wanted

        def read(response: "Any") -> "Any":
            self._be_all(wanted, response.types)
            return {wanted[i]: response.types[i] for i in range(len(wanted))}

        return self._ask("GetParameterTypes", "get_parameter_types", request, read, timeout, then)

    def describe(
        self, name: str, timeout: "float | None" = None, then: "Callable[[Any], object] | None" = None
    ) -> "Any":
        """A ``Parameter`` with all but the value. ParameterNotDeclaredError if there is none."""
        request = self._kind("srv/DescribeParameters").Request()
        request.names = [name]
        described = borrow("muros.rclc.parameter_values").described

        def read(response: "Any") -> "Any":
            self._be_all([name], response.descriptors)
            return described(response.descriptors[0])

        return self._ask("DescribeParameters", "describe_parameters", request, read, timeout, then)

    def list(
        self,
        prefixes: "Iterable[str]" = (),
        depth: int = 0,
        timeout: "float | None" = None,
        then: "Callable[[Any], object] | None" = None,
    ) -> "Any":
        """The names of parameters; see ``Parameters.list``."""
        request = self._kind("srv/ListParameters").Request()
        request.prefixes = list(prefixes)
        request.depth = depth
        return self._ask(
            "ListParameters",
            "list_parameters",
            request,
            lambda response: response.result.names,
            timeout,
            then,
        )

    def set(
        self,
        name: str,
        value: "Any",
        timeout: "float | None" = None,
        then: "Callable[[Any], object] | None" = None,
    ) -> "Any":
        """Sets a parameter; gives the node's remark. ParameterRejectedError with its reason if it refuses."""
        return self.update({name: value}, False, timeout, then)

    def delete(
        self, name: str, timeout: "float | None" = None, then: "Callable[[Any], object] | None" = None
    ) -> "Any":
        """Takes a parameter away, if the node allows that; as ``set``."""
        return self.update({name: None}, False, timeout, then)

    def update(
        self,
        values: "dict[str, Any]",
        atomically: bool = True,
        timeout: "float | None" = None,
        then: "Callable[[Any], object] | None" = None,
    ) -> "Any":
        """Sets several parameters, all or none; None deletes one. ParameterRejectedError if the node refuses.

        If not ``atomically``, each is set that can be, and the error names the others.
        """
        return self._update(values, {}, atomically, timeout, then)

    def _update(
        self,
        values: "dict[str, Any]",
        known: "dict[str, int]",
        atomically: bool,
        timeout: "float | None",
        then: "Callable[[Any], object] | None",
    ) -> "Any":
        """``update``; ``known`` are the types of lists without an element."""
        lib = borrow("muros.rclc.parameter_values")
        service = "SetParametersAtomically" if atomically else "SetParameters"
        request = self._kind("srv/" + service).Request()
        wanted = []
        for name in values:
            value = values[name]
            kind = lib.kind_of(value, known.get(name, 0))
            if value is not None and kind == 0:
                from muros.rclc.parameter_errors import InvalidParameterError

                raise InvalidParameterError(
                    "parameter %r cannot be %r: a value is a bool, int, float, str, bytes, or a list of one of these"
                    % (name, value)
                )
            made = self._kind("msg/Parameter")()
            made.name = name
            made.value = lib.put(self._kind("msg/ParameterValue")(), kind, value)
            wanted.append(made)
        request.parameters = wanted

        def read(response: "Any") -> "Any":
            results = [response.result] if atomically else response.results
            refused = []
            for i in range(len(results)):
                if not results[i].successful:
                    what = ", ".join([p.name for p in wanted]) if atomically else wanted[i].name
                    refused.append("%s: %s" % (what, results[i].reason or "no reason given"))
            if refused or len(results) < (1 if atomically else len(wanted)):
                from muros.rclc.parameter_errors import ParameterRejectedError

                raise ParameterRejectedError(
                    "%s refuses %s" % (self.target, "; ".join(refused) or "to answer for each")
                )
            return results[0].reason if results else ""

        suffix = "set_parameters_atomically" if atomically else "set_parameters"
        return self._ask(service, suffix, request, read, timeout, then)

    def on_event(self, callback: "Callable[[Any], object]") -> "Any":
        """A subscription: ``callback(event)``, rcl_interfaces/msg/ParameterEvent, for each change at that node."""

        def heard(event: "Any") -> None:
            if event.node == self.target:
                callback(event)

        kind = self._kind("msg/ParameterEvent")
        return self.node.subscription(kind, "/parameter_events", heard, "parameters", self._bounds(kind))

    def destroy(self) -> None:
        """Takes the clients away."""
        for client in self._clients.values():
            self.node.entities.remove(client)
            client.destroy()
        self._clients = {}

    def _ask(
        self,
        service: str,
        suffix: str,
        request: "Any",
        read: "Callable[[Any], Any]",
        timeout: "float | None",
        then: "Callable[[Any], object] | None",
    ) -> "Any":
        """Asks and hands on what ``read`` makes of the answer."""
        if timeout is None:
            timeout = self.timeout
        client = self._clients.get(suffix)
        if client is None:
            kind = self._kind("srv/" + service)
            name = self.target + "/" + suffix
            client = self.node.client(kind, name, "parameters", self._bounds(kind.Response))
            self._clients[suffix] = client
        if then is None:
            response = client.call(request, timeout)
            if response is None:
                raise self._silent(timeout)
            return read(response)

        def answered(response: "Any") -> None:
            from muros.rclc.parameter_errors import ParameterError

            try:
                result = self._silent(timeout) if response is None else read(response)
            except ParameterError as error:
                result = error
            then(result)

        if not client.send(request, answered, timeout):
            from muros.rclc.parameter_errors import ParameterError

            raise ParameterError("%s is not asked: the link is down or full, try again" % self.target)
        return None

    def _silent(self, timeout: float) -> "Exception":
        from muros.rclc.parameter_errors import ParameterTimeoutError

        return ParameterTimeoutError(
            "%s did not answer within %g s: is it there, and does it have parameters?"
            % (self.target, timeout)
        )

    def _be_all(self, names: "Any", answers: "Any") -> None:
        """ParameterNotDeclaredError unless there is an answer for each name."""
        if len(answers) != len(names):
            from muros.rclc.parameter_errors import ParameterNotDeclaredError

            raise ParameterNotDeclaredError(
                "%s has no parameter %s" % (self.target, " or ".join([repr(name) for name in names]))
            )

    def _bounds(self, kind: "Any") -> "Rules | None":
        """The rules that are for a type."""
        if self.memory is None:
            return None
        mine: "Rules" = borrow("muros.rclc.memory_plan").divide(self.memory, "", [kind])[0]
        return mine

    def _kind(self, name: str) -> "Any":
        """A type of rcl_interfaces."""
        return borrow("muros.rclc.parameter_making").find(name)
