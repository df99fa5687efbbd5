"""What may become of parameters: all changes go through here, those of the program and those of others.

A change is judged as a whole: parameters that are set together are all changed, or none is. Boards borrow this.
"""

from muros.compat import const
from muros.rclc.parameter_values import TYPES, kept, kind_of, put
from muros.rclc.parameters import Parameter

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.rclc.parameters import Parameters

_ERROR = const(1)
_REJECTED = const(4001)
_TYPE_MISMATCH = const(4002)
_INTEGER = const(2)
_DOUBLE = const(3)

# Rounding that a range forgives, as rclcpp: relative, and more where floats are single.
_ROUNDING = 2.220446e-14 if 1.0 + 1e-12 != 1.0 else 1.2e-5


def update(self: "Parameters", values: "dict[str, Any]") -> None:
    """Sets several parameters of ours at once: all or none. A ParameterError says what stands against it."""
    busy(self)
    wanted = []
    for name in values:
        value = values[name]
        found = self.known.get(name)
        kind = kind_of(value, 0 if found is None else found.type)
        if kind == 0:
            from muros.rclc.parameter_errors import InvalidParameterError

            raise InvalidParameterError(
                "parameter %r cannot be %r: a value is a bool, int, float, str, bytes, or a list of one of these"
                % (name, value)
            )
        wanted.append((name, kind, kept(kind, value)))
    news: "list[list[Parameter]]" = [[], [], []]
    code, why = change(self, wanted, False, news)
    if code:
        _refuse(self, code, why, wanted)
    tell(self, news)


def change(
    self: "Parameters", wanted: "list[tuple[str, int, Any]]", remote: bool, news: "list[list[Parameter]]"
) -> "tuple[int, str]":
    """Changes parameters, each a (name, type, value) where type 0 deletes: all or none.

    Returns 0 and a remark, or the code and the reason why nothing was changed. ``news`` gets what was added, what
    was changed and what was deleted, for ``tell``.
    """
    plan: "dict[str, tuple[Parameter | None, Parameter | None]]" = {}
    order: "list[str]" = []
    room = (self.max or len(self.known) + len(wanted)) - len(self.known)
    for name, kind, value in wanted:
        old = self.known.get(name)
        code, why = _judge(self, old, name, kind, value, remote)
        if not code and old is None and name not in plan:
            room -= 1
            if room < 0:
                code, why = _ERROR, "Parameter server is full"
        if code:
            return code, why
        if name not in plan:
            order.append(name)
        plan[name] = (old, _changed(old, name, kind, value) if kind else None)
    for name in order:
        old, new = plan[name]
        if not _agreed(self, old, new):
            return _REJECTED, "New parameter rejected" if old is None else "Rejected by server"
    remark = ""
    for name in order:
        old, new = plan[name]
        if new is not None:
            self.known[name] = new
            news[0 if old is None else 1].append(new)
            if old is None:
                remark = "New parameter added"
        elif old is not None:
            del self.known[name]
            news[2].append(old)
    return 0, remark


def tell(self: "Parameters", news: "list[list[Parameter]]") -> None:
    """Publishes an event of what was added, changed and deleted, if anything was."""
    added, changed, deleted = news
    if self.events is None or not (added or changed or deleted):
        return
    event = self.kind("msg/ParameterEvent")()
    event.node = self.full_name
    if self.clock is not None:
        now = self.clock()
        event.stamp.sec = now // 1000000000
        event.stamp.nanosec = now % 1000000000
    event.new_parameters = [_message(self, parameter) for parameter in added]
    event.changed_parameters = [_message(self, parameter) for parameter in changed]
    event.deleted_parameters = [_message(self, parameter) for parameter in deleted]
    if not self.events.publish(event):
        self.lost += 1


def busy(self: "Parameters") -> None:
    """ParameterChangingError within the callback of a change."""
    if self.changing:
        from muros.rclc.parameter_errors import ParameterChangingError

        raise ParameterChangingError(
            "the callback of a change can read parameters of %s, and change none" % self.full_name
        )


def unknown(self: "Parameters", name: str) -> None:
    """Raises ParameterNotDeclaredError."""
    from muros.rclc.parameter_errors import ParameterNotDeclaredError

    raise ParameterNotDeclaredError(
        "%s has no parameter %r; it has %s"
        % (self.full_name, name, ", ".join(sorted(self.known)) or "none: declare it")
    )


def within(parameter: "Parameter", value: "Any") -> bool:
    """Whether a value is in the range of a parameter, as rclcpp has it."""
    if parameter.range is None:
        return True
    least, largest, step = parameter.range
    if parameter.type == _INTEGER:
        return bool(
            value == largest or (least <= value <= largest and (step == 0 or (value - least) % step == 0))
        )
    if value == largest or _near(value, least) or _near(value, largest):
        return True
    if not least <= value <= largest:
        return False
    return step == 0.0 or _near(value, least + int((value - least) / step + 0.5) * step)


def _near(value: float, other: float) -> bool:
    gap = abs(value - other)
    return gap - gap == 0 and gap <= _ROUNDING * abs(value + other)  # no rounding makes it infinite


def _judge(
    self: "Parameters", old: "Parameter | None", name: str, kind: int, value: "Any", remote: bool
) -> "tuple[int, str]":
    """The code and the reason that stand against a change before anybody is asked; 0 if none does."""
    if old is None:
        if kind and self.undeclared and name and (not self.longest or len(name) <= self.longest):
            return 0, ""
        return _ERROR, "Parameter not found"
    if remote and old.read_only:
        return _REJECTED, "Read only parameter"
    if kind == 0:
        return 0, ""
    if kind != old.type:
        return _TYPE_MISMATCH, "Type mismatch"
    if not within(old, value):
        return _REJECTED, "Parameter {%s} doesn't comply with %s range." % (
            name,
            "integer" if kind == _INTEGER else "floating point",
        )
    return 0, ""


def _agreed(self: "Parameters", old: "Parameter | None", new: "Parameter | None") -> bool:
    """Whether the program agrees."""
    if self.changed is None:
        return True
    self.changing = True
    try:
        return bool(self.changed(old, new))
    finally:
        self.changing = False


def _changed(old: "Parameter | None", name: str, kind: int, value: "Any") -> "Parameter":
    """A parameter with another value, else as it was."""
    new = Parameter(name, kind, value)
    if old is not None:
        for what in ("description", "constraints", "read_only", "range"):
            if getattr(old, what):
                setattr(new, what, getattr(old, what))
    return new


def _message(self: "Parameters", parameter: "Parameter") -> "Any":
    """A parameter as rcl_interfaces/msg/Parameter."""
    made = self.kind("msg/Parameter")()
    made.name = parameter.name
    value = self.kind("msg/ParameterValue")()
    made.value = put(value, parameter.type, parameter.value)
    return made


def _refuse(self: "Parameters", code: int, why: str, wanted: "list[tuple[str, int, Any]]") -> None:
    """Raises what stands against a change that the program wants."""
    from muros.rclc.parameter_errors import ParameterRejectedError, ParameterTypeError

    for name, kind, _ in wanted:
        found = self.known.get(name)
        if found is None and not self.undeclared:
            unknown(self, name)
        if code == _TYPE_MISMATCH and found is not None and found.type != kind:
            raise ParameterTypeError(
                "parameter %r of %s is of type %s, not %s"
                % (name, self.full_name, TYPES[found.type], TYPES[kind])
            )
    if code == _ERROR:
        from muros.rclc.errors import CapacityError

        raise CapacityError(
            "%s is full: %d parameters. Make room with node.parameters(max=%d)."
            % (self.full_name, self.max, self.max + 1)
        )
    names = ", ".join([name for name, _, _ in wanted])
    raise ParameterRejectedError("%s of %s is not set: %s" % (names, self.full_name, why))
