"""What the six services of parameters answer: as rclcpp does, with the reasons of micro-ROS. Boards borrow this."""

from muros.compat import const
from muros.rclc.parameter_making import list_ as list_names
from muros.rclc.parameter_rules import change, tell
from muros.rclc.parameter_values import descriptor, is_type, put, take

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.rclc.parameters import Parameter, Parameters

_DOUBLE = const(3)


def get(self: "Parameters", request: "Any") -> "Any":
    """GetParameters: the values; none at all if one name is not declared, and nothing may be undeclared."""
    response = self.kind("srv/GetParameters").Response()
    response.values = [_value(self, name) for name in request.names] if _all(self, request.names) else []
    return response


def types(self: "Parameters", request: "Any") -> "Any":
    """GetParameterTypes, in the same way."""
    response = self.kind("srv/GetParameterTypes").Response()
    if _all(self, request.names):
        kinds = [self.known[name].type if name in self.known else 0 for name in request.names]
        response.types = bytes(kinds)
    return response


def describe(self: "Parameters", request: "Any") -> "Any":
    """DescribeParameters, in the same way."""
    response = self.kind("srv/DescribeParameters").Response()
    if _all(self, request.names):
        response.descriptors = [_descriptor(self, name) for name in request.names]
    return response


def list_(self: "Parameters", request: "Any") -> "Any":
    """ListParameters: names, sorted, and all that stands before their last dots."""
    response = self.kind("srv/ListParameters").Response()
    names = list_names(self, request.prefixes, request.depth)
    prefixes: "list[str]" = []
    for name in names:
        prefix = name[: max(name.rfind("."), 0)]
        if "." in name and prefix not in prefixes:
            prefixes.append(prefix)
    response.result.names = names
    response.result.prefixes = prefixes
    return response


def set_(self: "Parameters", request: "Any") -> "Any":
    """SetParameters: each by itself."""
    response = self.kind("srv/SetParameters").Response()
    failure: "Exception | None" = None
    results = []
    news: "list[list[Parameter]]" = [[], [], []]
    for parameter in request.parameters:
        if self.low_memory and len(request.parameters) > 1:
            code, why = 1, "One parameter a request"
        else:
            try:
                code, why = _change(self, [parameter], news)
            except Exception as error:
                failure = error
                code, why = 1, "Set parameter error"
        results.append(_result(self, code, why))
    tell(self, news)
    response.results = results
    if failure is not None:
        self.handles[2].reply(self.handles[2].identity, response)
        raise failure
    return response


def set_atomically(self: "Parameters", request: "Any") -> "Any":
    """SetParametersAtomically: all or none."""
    response = self.kind("srv/SetParametersAtomically").Response()
    news: "list[list[Parameter]]" = [[], [], []]
    try:
        code, why = (1, "One parameter a request")
        if not self.low_memory or len(request.parameters) <= 1:
            code, why = _change(self, request.parameters, news)
        response.result = _result(self, code, why)
    except Exception:
        response.result = _result(self, 1, "Set parameter error")
        self.handles[3].reply(self.handles[3].identity, response)
        raise
    tell(self, news)
    return response


def _change(self: "Parameters", parameters: "Any", news: "list[list[Parameter]]") -> "tuple[int, str]":
    wanted = []
    for parameter in parameters:
        value = parameter.value
        if not is_type(value.type):
            return 1, "Type not supported"
        wanted.append((parameter.name, value.type, take(value)))
    return change(self, wanted, True, news)


def _result(self: "Parameters", code: int, why: str) -> "Any":
    made = self.kind("msg/SetParametersResult")()
    made.successful = code == 0
    made.reason = why
    return made


def _all(self: "Parameters", names: "Any") -> bool:
    """Whether there is an answer: everything is declared, or need not be; one name a request with low memory."""
    if self.low_memory and len(names) > 1:
        return False
    return self.undeclared or not [name for name in names if name not in self.known]


def _value(self: "Parameters", name: str) -> "Any":
    made = self.kind("msg/ParameterValue")()
    found = self.known.get(name)
    return made if found is None else put(made, found.type, found.value)


def _descriptor(self: "Parameters", name: str) -> "Any":
    made = self.kind("msg/ParameterDescriptor")()
    found = self.known.get(name)
    if found is None:
        made.name = name
        return made
    span: "Any" = None
    if found.range is not None:
        span = self.kind("msg/FloatingPointRange" if found.type == _DOUBLE else "msg/IntegerRange")()
    return descriptor(made, found, span)
