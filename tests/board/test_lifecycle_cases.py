"""Managed nodes on every runtime, by the ids of the acceptance cases, and moved by another board."""

from muros.compat import const
from muros.rclc import CapacityError, Executor, LifecycleClient, TransitionError
from tests.board.broker import Broker
from tests.board.harness import raises

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

_UNCONFIGURED = const(1)
_INACTIVE = const(2)
_ACTIVE = const(3)
_FINALIZED = const(4)


class Managed:
    """A managed node, and what was called."""

    def __init__(self, services: bool = True) -> None:
        self.broker = Broker()
        self.called: "list[str]" = []
        self.node = self.broker.context().node("arm", "lab")
        self.lifecycle = self.node.lifecycle(
            on_configure=lambda: self.called.append("configure"),
            on_activate=lambda: self.called.append("activate"),
            on_deactivate=lambda: self.called.append("deactivate"),
            on_cleanup=lambda: self.called.append("cleanup"),
            services=services,
            time=lambda: (7, 8),
        )


def test_l1_create_and_destroy() -> None:
    managed = Managed()
    assert (managed.lifecycle.state, len(managed.lifecycle.services)) == ("unconfigured", 5)
    managed.broker.settle()
    managed.node.destroy()
    managed.broker.settle()
    assert managed.node.context.handles == []
    assert managed.broker.lines[0].objects == {}
    assert Managed(services=False).lifecycle.services == []


def test_l2_l3_to_active_and_back() -> None:
    managed = Managed()
    managed.broker.settle()
    lifecycle = managed.lifecycle
    states = []
    for step in (lifecycle.configure, lifecycle.activate, lifecycle.deactivate, lifecycle.cleanup):
        assert step()
        managed.broker.run(20)
        states.append(lifecycle.id)
        assert len(managed.called) == len(states)
    assert states == [_INACTIVE, _ACTIVE, _INACTIVE, _UNCONFIGURED]
    assert managed.called == ["configure", "activate", "deactivate", "cleanup"]
    assert lifecycle.lost == 0
    with raises(TransitionError) as caught:
        lifecycle.activate()
    error: "Any" = caught.value
    assert error.code == 1


def test_l4_services_are_handles_that_an_executor_counts() -> None:
    managed = Managed()
    first, second, third = managed.lifecycle.services[:3]
    small = Executor(managed.node.context, 1)
    small.add(first)
    with raises(CapacityError):
        small.add(second)
    large = Executor(managed.node.context, 3)
    for handle in (first, second, third):
        large.add(handle)


def test_l2_another_board_moves_it() -> None:
    managed = Managed()
    mover = LifecycleClient(managed.broker.context().node("mover"), "/lab/arm")
    events: "list[Any]" = []
    mover.on_event(lambda start, goal: events.append((start, goal)))
    managed.broker.settle()
    assert mover.state() == "unconfigured"
    assert len(mover.states()) == 11
    assert [row[1] for row in mover.transitions()] == ["configure", "shutdown"]
    assert len(mover.transitions(everything=True)) == 25
    assert mover.change("activate") is False
    assert mover.change("configure") and mover.change(3) and mover.change("shutdown")
    assert (managed.lifecycle.id, mover.transitions()) == (_FINALIZED, [])
    managed.broker.run(20)
    assert events == [
        ("unconfigured", "configuring"),
        ("configuring", "inactive"),
        ("inactive", "activating"),
        ("activating", "active"),
        ("active", "shuttingdown"),
        ("shuttingdown", "finalized"),
    ]
