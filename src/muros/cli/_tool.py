"""What every command that looks into the graph works with: a space, a place in it, and one way to end.

A command is a coroutine `command(tool, arguments)`. `run_command` opens the space that the arguments name, serves it on
one asyncio loop, runs the command and takes everything out of the graph again, whatever happened: an error, the
end of a pipe, SIGINT or SIGTERM. Commands that are given a `Tool` on another space (tests, programs) are the same.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import re
import signal
import sys
import time
from collections.abc import Awaitable, Callable, Iterable
from typing import TYPE_CHECKING, Final, TextIO

if TYPE_CHECKING:
    from muros.space import Endpoint, Graph, Participant, Qos, Reader, Sample, Space, Topic

__all__ = [
    "CommandError",
    "Subscription",
    "Tool",
    "add_space_options",
    "fail",
    "positive",
    "printable",
    "run_command",
]

FAILED: Final = 1
WRONG_USE: Final = 2
TERMINATED: Final = 128 + signal.SIGTERM

SPIN_TIME: Final = 1.0
"""Seconds that discovery may take; it ends earlier when nothing new comes any more."""

QUIET: Final = 0.3
"""Part of the spin time without anything new after which discovery is taken to be complete."""

SETTLED: Final = 0.1
"""The same when what is looked for is there already: others of its kind may be close behind."""

PATIENCE: Final = 4
"""Times the spin time for which discovery goes on as long as new things keep coming."""

PROGRESS_AFTER: Final = 1.5
"""Seconds of discovery after which a terminal is told how far it is."""

PROGRESS_PERIOD: Final = 0.5
"""Seconds between two such tellings."""

HIDDEN_NODE: Final = "_muros_"
"""Names of the commands' own nodes begin so: as all that begin with an underscore, they are not listed."""


_CONTROL: Final = re.compile(r"[\0-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""Control characters, and those that turn the direction of writing."""


class CommandError(Exception):
    """A command cannot do what was asked; the text is one clear line. `status` is what the process ends with."""

    def __init__(self, text: str, status: int = FAILED) -> None:
        super().__init__(text)
        self.status = status


class Tool:
    """A space and the command's own participant in it, which others do not see as a node of theirs.

    `domain` None means that of the space. `spin_time`: seconds that discovery may take.
    """

    def __init__(
        self,
        space: Space,
        *,
        domain: int | None = None,
        spin_time: float = SPIN_TIME,
        node_name: str = "",
        out: TextIO | None = None,
        err: TextIO | None = None,
    ) -> None:
        self.space = space
        self.domain = space.domain if domain is None else domain
        self.spin_time = spin_time
        self.node_name = node_name or f"{HIDDEN_NODE}{os.getpid()}"
        self._out = out
        self._err = err
        self._participant: Participant | None = None
        self._progressing = False

    @property
    def participant(self) -> Participant:
        """The command's own place in the space, made when it is first needed. InterfaceError for a bad name."""
        if self._participant is None:
            from muros.interfaces import check_namespace, check_node_name

            namespace, _, name = self.node_name.rpartition("/")
            self._participant = self.space.participant(
                check_node_name(name), namespace=check_namespace(namespace), domain=self.domain
            )
        return self._participant

    @property
    def graph(self) -> Graph:
        """The graph of the space, all domains and this command included."""
        return self.space.graph

    def others(self, endpoints: Iterable[Endpoint]) -> list[Endpoint]:
        """Those of this domain that are not the command's own."""
        own = self.participant.gid
        return [e for e in endpoints if e.participant.domain == self.domain and e.participant.gid != own]

    def print(self, text: object = "", end: str = "\n") -> None:
        """A result, at once: whoever reads a pipe sees each sample when it comes."""
        print(printable(str(text)), end=end, file=self._out or sys.stdout, flush=True)

    def say(self, text: object) -> None:
        """A remark for the person, not part of the result."""
        err = self._err or sys.stderr
        if err is sys.stderr:
            sys.stdout.flush()
        print(f"muros: {printable(str(text))}", file=err, flush=True)

    async def discover(self, until: Callable[[Graph], bool] | None = None) -> None:
        """Wait until the graph is known as far as it goes, for about `spin_time`; hardly at all once `until` holds.

        It ends early when something came and then nothing new for a while, and goes on longer while new things
        keep coming.
        """
        own = self.participant.gid
        loop = asyncio.get_running_loop()
        start = last = loop.time()
        news = asyncio.Event()
        heard = False

        def on_change(event: object) -> None:
            nonlocal last, heard
            last = loop.time()
            heard = heard or not _concerns(event, own)
            news.set()

        end_watch = self.graph.watch(on_change)
        try:
            while True:
                found = until is not None and until(self.graph)
                quiet = (SETTLED if found else QUIET) * self.spin_time
                end = last + quiet if heard or found else start + self.spin_time
                left = min(end, start + PATIENCE * self.spin_time) - loop.time()
                if left <= 0:
                    return
                self._progress(loop.time() - start)
                news.clear()
                await _within(news.wait(), min(left, PROGRESS_PERIOD))
        finally:
            end_watch()
            self._progress(None)

    async def wait_for(self, condition: Callable[[Graph], bool], timeout: float | None = None) -> bool:
        """Wait until `condition` holds, asked again after each change of the graph. False: it took too long."""
        end = None if timeout is None else time.monotonic() + timeout
        news = asyncio.Event()
        end_watch = self.graph.watch(lambda _: news.set())
        try:
            while not condition(self.graph):
                left = None if end is None else end - time.monotonic()
                if left is not None and left <= 0:
                    return False
                news.clear()
                await _within(news.wait(), left)
            return True
        finally:
            end_watch()

    def _progress(self, seconds: float | None) -> None:
        """On a terminal, show how far discovery is when it takes long; None takes the line away again."""
        err = self._err or sys.stderr
        if seconds is None:
            if not self._progressing:
                return
            text = ""
        else:
            if seconds < PROGRESS_AFTER or not err.isatty():
                return
            others = sum(p.domain == self.domain for p in self.graph.participants) - 1
            text = f"looking into domain {self.domain} for {seconds:.0f} s: {others} found"
        self._progressing = seconds is not None
        print(f"\r{text}\x1b[K", end="", file=err, flush=True)

    def subscribe(self, topic: Topic, qos: Qos, handle: Callable[[Sample], object]) -> Subscription:
        """Hand every sample of a topic to `handle` as it comes."""
        return Subscription(self.participant, topic, qos, handle)

    def close(self) -> None:
        """Leave the space and close it."""
        self.space.close()


class Subscription:
    """A reader whose samples go to a function; what the function raises comes out of `done`."""

    def __init__(
        self, participant: Participant, topic: Topic, qos: Qos, handle: Callable[[Sample], object]
    ) -> None:
        self.done: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._handle = handle
        self.reader = participant.reader(topic, qos, self._on_data)

    def finish(self) -> None:
        """That was enough: `done` is done, no more samples are handed over."""
        if not self.done.done():
            self.done.set_result(None)

    async def wait(self, seconds: float | None = None) -> bool:
        """Wait for the end, or for so many seconds. True: it has ended; raises what the function raised."""
        if seconds is None:
            await self.done
        else:
            await asyncio.wait({self.done}, timeout=seconds)
        if self.done.done():
            self.done.result()
            return True
        return False

    def _on_data(self, reader: Reader) -> None:
        while not self.done.done() and (sample := reader.take()) is not None:
            try:
                self._handle(sample)
            except Exception as error:
                if not self.done.done():
                    self.done.set_exception(error)


def add_space_options(parser: argparse.ArgumentParser) -> None:
    """Where to look: `--space`, `-d`, `--spin-time`, and what `ros2` knows besides and muros does not need."""
    group = parser.add_argument_group("the graph")
    group.add_argument(
        "--space", metavar="URL", default="dds:", help="the data space: dds: (default), dds:42, cyclonedds:"
    )
    group.add_argument(
        "-d", "--domain", type=domain_number, metavar="N", help="DDS domain (default: $ROS_DOMAIN_ID or 0)"
    )
    group.add_argument(
        "--spin-time",
        type=positive,
        default=SPIN_TIME,
        metavar="S",
        help=f"seconds that discovery may take (default: {SPIN_TIME:g}; it ends early when nothing new comes)",
    )
    # ros2's commands have a daemon; scripts that switch it off go on working.
    group.add_argument("--no-daemon", action="store_true", help=argparse.SUPPRESS)
    group.add_argument("-s", "--use-sim-time", action="store_true", help=argparse.SUPPRESS)


def run_command(
    arguments: argparse.Namespace, command: Callable[[Tool, argparse.Namespace], Awaitable[int | None]]
) -> int:
    """Open the space, run the command in it, leave; returns the exit status. Errors of use are one line."""
    from muros.cdr import CdrError
    from muros.interfaces import InterfaceError
    from muros.space import SpaceError

    try:
        return asyncio.run(_main(arguments, command))
    except asyncio.CancelledError:
        return TERMINATED
    except CommandError as error:
        return fail(error, error.status)
    except (SpaceError, InterfaceError, CdrError) as error:
        return fail(error)
    except BrokenPipeError:
        raise
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return fail(f"{where}{error.strerror or error}")


def fail(error: object, status: int = FAILED) -> int:
    """Say what went wrong in one line; returns the status to end with."""
    print(f"muros: {printable(str(error))}", file=sys.stderr)
    return status


def printable(text: str) -> str:
    """`text` with control characters escaped, but line ends and tabs: names come from others."""
    return _CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def positive(text: str) -> float:
    """An argument that is a number above 0."""
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def domain_number(text: str) -> int:
    """An argument that is a DDS domain: DDSI-RTPS 2.3, 9.6.1.1 has ports for 0 to 232."""
    value = int(text)
    if not 0 <= value <= 232:
        raise argparse.ArgumentTypeError(f"{text} is no domain; take one from 0 to 232")
    return value


async def _main(
    arguments: argparse.Namespace, command: Callable[[Tool, argparse.Namespace], Awaitable[int | None]]
) -> int:
    from muros.space import open_space

    loop = asyncio.get_running_loop()
    this = asyncio.current_task()
    if this is not None:
        loop.add_signal_handler(signal.SIGTERM, this.cancel)
    space = open_space(space_url(arguments.space, arguments.domain))
    tool = Tool(space, spin_time=arguments.spin_time, node_name=getattr(arguments, "own_name", None) or "")
    try:
        space.attach(loop)
        return await command(tool, arguments) or 0
    finally:
        tool.close()
        await asyncio.sleep(0)  # lets the loop send what closing wrote


def space_url(url: str, domain: int | None) -> str:
    """The URL with the domain of `-d`; CommandError if it names another one itself."""
    engine, _, rest = url.partition(":")
    if domain is None:
        return f"{engine}:{rest}"
    if rest and rest != str(domain):
        raise CommandError(f"--space {url} and -d {domain} contradict each other: leave one out", WRONG_USE)
    return f"{engine}:{domain}"


async def _within(what: Awaitable[object], seconds: float | None) -> None:
    """Wait for something, at most so long."""
    with contextlib.suppress(TimeoutError):
        await asyncio.wait_for(what, seconds)


def _concerns(event: object, own: bytes) -> bool:
    """Whether a graph event is about the participant `own` alone."""
    what = getattr(event, "what", None)
    if what is None:
        return True
    participant = getattr(what, "participant", what)
    return bool(participant.gid == own)
