"""Plans by which the bodies of messages are held to rules; see ``memory``. Boards borrow this.

The words of a shape are explained where they are made, in ``muros.interfaces``.
"""

from muros.compat import MPY, borrow, const
from muros.rclc.memory import REFUSED, RulesError

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from muros.rclc.memory import Guard, Rules

_SKIP = const(0)
_TEXT = const(1)
_NUMBERS = const(2)
_LOOP = const(3)
_TIMES = const(4)
_NEXT = const(5)
_WIDE = const(4)  # bytes of a character of wstring
_STEP = const(3)  # numbers for each


def make(rules: "Rules", kind: "Any") -> "list[int]":
    """The plan for a type: steps of three numbers. Raises RulesError for a rule that is for no member."""
    plan: "list[int]" = []
    open_: "list[int]" = []
    known: "list[str]" = []
    walker = Walker(kind)
    for word in walker:
        if walker.path:
            known.append(walker.path)
        form = walker.form
        if form == "{":
            continue
        if word == ")":
            plan += (_NEXT, 0, 0)
            plan[open_.pop()] = len(plan)
        elif form == "":
            size, _, count = word.partition("*")
            plan += (_SKIP, int(size), int(size) * int(count or 1))
        elif form[-1] == "(":
            plan += (_TIMES, int(form[:-1]), 0)
            open_.append(len(plan) - 1)
        else:
            most = capacity(rules, walker.path, form)
            if form[0] == "[":
                plan += (_LOOP, most, 0)
                open_.append(len(plan) - 1)
            elif form[0] in "sw":
                plan += (_TEXT, most, 1 if form[0] == "s" else _WIDE)
            else:
                plan += (_NUMBERS, most, int(form[0]))
    for path in rules.rules:
        if path not in known:
            raise RulesError("%s has no string or sequence %r" % (kind.TYPE, path))
    return plan


def divide(rules: "Rules", what: str, kinds: "Sequence[Any]") -> "list[Rules]":
    """The rules for each of the types that ``what`` takes: those that are for members of the type.

    Raises RulesError for a rule that is for no member of any; where ``what`` is empty, it may be for a type to come.
    """
    made = []
    known: "list[str]" = []
    for kind in kinds:
        walker = Walker(kind)
        paths = [walker.path for _ in walker if walker.path]
        known += paths
        mine = {path: rules.rules[path] for path in paths if path in rules.rules}
        made.append(type(rules)(mine, rules.strings, rules.messages, rules.numbers))
    for path in rules.rules:
        if what and path not in known:
            raise RulesError("%s has no string or sequence %r" % (what, path))
    return made


class Walker:
    """Goes through the words of a type's shape.

    ``form`` is what stands behind the name of the last word, or with ``)`` behind the name of what ends there; "" for
    plain numbers. ``path`` is that of a string or sequence, "" for all else.
    """

    def __init__(self, kind: "Any") -> None:
        self.words = shape(kind).split(" ")
        self.path = self.form = ""
        self._names: "list[str]" = []
        self._forms: "list[str]" = []
        self._at = 0

    def __iter__(self) -> "Walker":
        return self

    def __next__(self) -> str:
        if self._at == len(self.words):
            raise StopIteration
        word = self.words[self._at]
        self._at += 1
        self.path = self.form = ""
        if word == ")":
            self._names.pop()
            self.form = self._forms.pop()
        elif ":" in word:
            name, self.form = word.split(":")
            opens = self.form[-1] in "{(" or self.form[0] == "["
            if self.form[-1] not in "{(":
                self.path = ".".join(self._names + [name])
            if opens:
                self._names.append(name)
                self._forms.append(self.form)
        return word


def capacity(rules: "Rules", path: str, form: str) -> int:
    """How many elements or bytes of text may be there: by a rule, the type's bound, or the default."""
    most = rules.rules.get(path, 0)
    if most:
        return most
    if form[0] in "sw":
        return int(form[1:] or rules.strings)
    _, _, bound = form.partition("<")
    return int(bound or (rules.messages if form[0] == "[" else rules.numbers))


def shape(kind: "Any") -> str:
    """The shape of a message class."""
    known = getattr(kind, "SHAPE", None)
    if known is None:
        if MPY:
            raise RulesError("%s has no shape: make its class with muros board copy --rules" % kind.TYPE)
        known = borrow("muros.interfaces").shape(kind.TYPE)
    found: str = known
    return found


def path(kind: "Any", step: int) -> str:
    """The path of the string or sequence at a step of the plan."""
    walker = Walker(kind)
    at = 0
    for _ in walker:
        if walker.form != "{":
            if at == step:
                break
            at += _STEP
    return walker.path


def tell(guard: "Guard", n: int, step: int) -> None:
    """Tells of a refused sample of ``n`` bytes, which broke a step of the plan; -1: there was no memory for it."""
    text = "%d B of %s dropped: " % (n, guard.kind.TYPE)
    if step < 0:
        text += "there is no memory for it"
    else:
        text += path(guard.kind, step) + " is longer than the rules allow"
    middleware = guard.handle.context.middleware
    if middleware.on_problem is not None:
        middleware.on_problem(REFUSED, text)
    elif not MPY:
        borrow("muros.client.reasons").say(text)
