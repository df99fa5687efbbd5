"""Bounds of what messages may take, so that a foreign message never takes more of a board than was meant for it.

    rules = Rules({"name": 8, "name.data": 16}, numbers=32)
    node.subscription(JointState, "joint_states", on_state, memory=rules)

Services, clients, both sides of actions and parameters take them too. A message beyond them is refused before any of
it is taken, counted in ``refused`` of its handle, and told as a problem with the path of what was too long. Boards need
the shape of the type for that: ``muros board copy --rules``.
"""

from muros.cdr import integer
from muros.compat import MPY, borrow, const, lend

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.rclc.executor import Handle
    from muros.rclc.host import memory as host_memory
    from muros.xrce._types import Buffer

REFUSED = const(17)
"""The code with which problems tell of a message that was refused."""

# Steps of a plan, three numbers each; see ``memory_plan``.
_SKIP = const(0)  # alignment, bytes
_TEXT = const(1)  # capacity, bytes of a character
_NUMBERS = const(2)  # capacity, bytes of each
_LOOP = const(3)  # capacity, the step behind its end
_TIMES = const(4)  # how often, the step behind its end
_NEXT = const(5)  # ends both

_FITS = const(-1)
_STEP = const(3)


class RulesError(ValueError):
    """Rules that make no sense, or are for no member of what they are given for."""

    code = 11


class Rules:
    """How much the strings and sequences of messages may hold: elements of sequences, bytes of strings.

    ``rules`` has sizes for paths of member names, joined by dots, that go on in the elements of sequences; behind a
    sequence of strings ``.data`` stands for each of them. What has no rule is bounded by its type, or else by the
    default for ``strings``, for sequences of ``messages`` or strings, and of ``numbers``; 0 means the default. Raises
    RulesError, a ValueError, for sizes below 0.

    Hosts also say what that makes, see ``host.memory``: ``capacities(kind)``, ``size(kind)``, ``longest(kind)``.
    """

    if TYPE_CHECKING:
        capacities = host_memory.capacities
        size = host_memory.size
        static_size = host_memory.static_size
        longest = host_memory.longest
        carve = host_memory.carve
    else:

        def __getattr__(self, name):
            if MPY or name[0] == "_":
                raise AttributeError(name)
            return lend(self, "muros.rclc.host.memory", name)

    def __init__(
        self,
        rules: "dict[str, int] | None" = None,
        strings: int = 20,
        messages: int = 5,
        numbers: int = 5,
    ) -> None:
        self.rules = {} if rules is None else rules
        if not isinstance(self.rules, dict):
            raise RulesError("rules are a dict of paths and sizes, not %r" % (rules,))
        for size in [strings, messages, numbers] + list(self.rules.values()):
            if not isinstance(size, int) or size < 0:
                raise RulesError("%r is no size: rules are sizes, 0 or more" % (size,))
        self.strings = strings or 20
        self.messages = messages or 5
        self.numbers = numbers or 5

    def guard(self, handle: "Handle", kind: "Any") -> "Any":
        """What takes samples in place of a handle, and hands on to it what keeps to the rules.

        ``kind`` is what comes to it: of a service the class of the requests. Raises RulesError for a rule that is for
        no member of it, and on boards without its shape.
        """
        plan = borrow("muros.rclc.memory_plan").make(self, kind)
        return (Guard if handle.take else CallGuard)(handle, kind, plan)


class Guard:
    """Stands before a subscription; see ``Rules.guard``."""

    def __init__(self, handle: "Any", kind: "Any", plan: "list[int]") -> None:
        handle.refused = 0
        self.handle = handle
        self.kind = kind
        self.plan = plan
        self._stack: "list[int]" = []

    def deliver(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a sample of the middleware."""
        handle = self.handle
        if self.keeps(buf, off, n):
            if not MPY:
                handle.deliver(buf, off, n)
            else:
                if handle.ready(0) and handle.eager:
                    handle.run(0)  # what a callback raises is its own
                try:
                    handle.deliver(buf, off, n)
                except MemoryError:
                    self.refuse(n, _FITS)

    def keeps(self, buf: "Buffer", off: int, n: int) -> bool:
        """Whether a sample keeps to the rules; one that does not is refused."""
        step = check(self.plan, self._stack, buf, off, n)
        if step != _FITS:
            self.refuse(n, step)
        return step == _FITS

    def refuse(self, n: int, step: int) -> None:
        """Counts a sample of ``n`` bytes that breaks a step of the plan, -1 for one there was no memory for."""
        count = self.handle.refused + 1
        self.handle.refused = count
        if count & count - 1 == 0:  # the 1st, 2nd, 4th, 8th: a flood costs nothing
            try:
                borrow("muros.rclc.memory_plan").tell(self, n, step)
            except MemoryError:
                pass


class CallGuard(Guard):
    """Stands before a service, whose requests it looks at, or a client and its replies."""

    def deliver(self, whose: "Any", buf: "Buffer", off: int, n: int) -> None:  # type: ignore[override]
        """Takes a request or a reply of the middleware."""
        if self.keeps(buf, off, n):
            try:
                self.handle.deliver(whose, buf, off, n)
            except MemoryError:
                if not MPY:
                    raise
                self.refuse(n, _FITS)


def check(plan: "list[int]", stack: "list[int]", buf: "Buffer", off: int, n: int) -> int:
    """The step of the plan that a body breaks, -1 for none. What is malformed is left to the reader of the type.

    ``stack`` is room for what is still to be repeated.
    """
    while stack:
        stack.pop()
    end = off + n
    p = off
    i = 0
    while i < len(plan):
        step = plan[i]
        most = plan[i + 1]
        size = plan[i + 2]
        i += _STEP
        if step == _SKIP:
            p += off - p & most - 1
            p += size
        elif step == _NEXT:
            stack[-1] -= 1
            if stack[-1]:
                i = stack[-2]
            else:
                stack.pop()
                stack.pop()
            continue
        elif step == _TIMES:
            stack.append(i)
            stack.append(most)
        else:
            p += off - p & 3
            if end - p < 4:
                return _FITS
            count = integer(buf, p, 4, 0)
            p += 4
            if step == _TEXT:
                p += count * size
                if size == 1 and count:
                    count -= 1  # its NUL
            if count > most:
                return i - _STEP
            if step == _NUMBERS:
                if count:
                    p += off - p & size - 1
                p += count * size
            elif step == _LOOP:
                if count:
                    stack.append(i)
                    stack.append(count)
                else:
                    i = size
        if p > end:
            return _FITS
    return _FITS
