"""Contexts by the texts of rtc.conf."""

import json
from pathlib import Path

import pytest

from muros.rtc.codes import ExecutionKind, RtcError
from muros.rtc.contexts import (
    CONTEXT_TYPES,
    ContextOptions,
    ContextSpec,
    ExtTrigExecutionContext,
    MultilayerCompositeEC,
    PeriodicExecutionContext,
    SharedContexts,
    context_specs,
    make_context,
    make_contexts,
)
from tests.rtc.contexts.actors import Actor

VECTORS = Path(__file__).parents[2] / "vectors/rtc"


def test_a_component_that_says_nothing_has_one_periodic_context() -> None:
    (context,) = make_contexts({})
    assert isinstance(context, PeriodicExecutionContext)
    assert (context.rate, context.kind, context.name) == (1000.0, ExecutionKind.PERIODIC, "")
    assert context.options == ContextOptions()
    assert context.profile().properties == {
        "type": "PeriodicExecutionContext",
        "rate": "1000",
        "sync_transition": "YES",
        "transition_timeout": "0.5",
    }


def test_exec_cxt_says_what_the_one_context_is() -> None:
    (context,) = make_contexts(
        {
            "exec_cxt.periodic.type": "ExtTrigExecutionContext",
            "exec_cxt.periodic.rate": "50",
            "exec_cxt.sync_transition": "NO",
            "exec_cxt.periodic.sync_reset": "yes",
            "exec_cxt.transition_timeout": "3",
            "exec_cxt.periodic.reset_timeout": "4.5",
        }
    )
    assert isinstance(context, ExtTrigExecutionContext)
    options = context.options
    assert context.rate == 50.0
    assert (options.sync_activation, options.sync_deactivation, options.sync_reset) == (False, False, True)
    assert (options.activation_timeout, options.reset_timeout) == (3.0, 4.5)
    told = context.profile().properties
    assert (told["sync_transition"], told["transition_timeout"], told["sync_reset"]) == ("NO", "3", "yes")


def test_several_contexts_by_type_and_name() -> None:
    fast, slow, other = make_contexts(
        {
            "execution_contexts": "PeriodicExecutionContext(fast), PeriodicExecutionContext ( slow )"
            ",ExtTrigExecutionContext",
            "exec_cxt.periodic.type": "MultilayerCompositeEC",
            "exec_cxt.periodic.rate": "20",
            "exec_cxt.sync_transition": "NO",
            "ec.PeriodicExecutionContext.rate": "500",
            "ec.PeriodicExecutionContext.cpu_affinity": "0, 1",
            "ec.fast.rate": "2000",
            "ec.fast.sync_transition": "YES",
        }
    )
    assert [(c.name, c.type_name, c.rate) for c in (fast, slow, other)] == [
        ("fast", "PeriodicExecutionContext", 2000.0),
        ("slow", "PeriodicExecutionContext", 500.0),
        ("", "ExtTrigExecutionContext", 20.0),
    ]
    assert [c.options.sync_activation for c in (fast, slow, other)] == [True, False, False]
    assert [c.options.cpus for c in (fast, slow, other)] == [(0, 1), (0, 1), ()]


@pytest.mark.parametrize("text", ["none", "NONE"])
def test_no_context(text: str) -> None:
    assert make_contexts({"execution_contexts": text}) == ()


def test_same_type_and_name_is_one_context() -> None:
    shared = SharedContexts()
    properties = {"execution_contexts": "PeriodicExecutionContext(arm), ExtTrigExecutionContext(arm)"}
    first, other = make_contexts(properties, shared=shared)
    again, _ = make_contexts(properties, shared=shared)
    assert again is first
    assert other is not first
    assert make_contexts({}, shared=shared) != make_contexts({}, shared=shared)
    assert make_contexts(properties)[0] is make_contexts(properties)[0] is not first
    first.close()
    assert make_contexts(properties, shared=shared)[0] is not first


@pytest.mark.parametrize("name", list(CONTEXT_TYPES))
def test_every_kind_can_be_made_by_its_name(name: str) -> None:
    context = make_context(ContextSpec(name, "x", {"rate": "10"}))
    assert context.type_name == name
    assert context.profile().properties["type"] == name
    assert context.kind is (
        ExecutionKind.EVENT_DRIVEN if name.startswith("EventDriven") else ExecutionKind.PERIODIC
    )


@pytest.mark.parametrize(
    ("properties", "said"),
    [
        ({"exec_cxt.periodic.type": "PeriodicExcutionContext"}, "did you mean PeriodicExecutionContext?"),
        ({"exec_cxt.periodic.type": "?"}, "there are PeriodicExecutionContext, "),
        ({"exec_cxt.periodic.rate": "fast"}, "rate: 'fast' is no rate"),
        ({"exec_cxt.periodic.rate": "0"}, "rate: '0' is no rate"),
        ({"exec_cxt.transition_timeout": "-1"}, "transition_timeout: '-1' is no time"),
        ({"exec_cxt.catch_up": "1.5"}, "catch_up: '1.5' is no number of passes"),
        ({"exec_cxt.switch_interval": "x"}, "switch_interval: 'x' is no time"),
        ({"exec_cxt.cpu_affinity": "0-3"}, "cpu_affinity: '0-3' is no processor"),
        ({"exec_cxt.scheduling": "fifo:100"}, "scheduling: 'fifo:100' is unknown"),
        ({"exec_cxt.scheduling": "fast"}, "scheduling: 'fast' is unknown"),
        ({"execution_contexts": "Periodic)x("}, "execution_contexts: 'Periodic)x(' cannot be read"),
        ({"execution_contexts": "PeriodicExecutionContext(a), None"}, "execution context 'None' is unknown"),
    ],
)
def test_texts_that_cannot_be_used_are_named(properties: dict[str, str], said: str) -> None:
    with pytest.raises(RtcError) as caught:
        make_contexts(properties)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ("", 0)),
        ("SCHED_OTHER", ("", 0)),
        ("fifo", ("FIFO", 0)),
        ("fifo:50", ("FIFO", 50)),
        ("SCHED_RR 7", ("RR", 7)),
        ("round_robin:7", ("RR", 7)),
    ],
)
def test_scheduling(text: str, expected: tuple[str, int]) -> None:
    options = ContextOptions.from_properties({"scheduling": text})
    assert (options.policy, options.priority) == expected


def test_groups_of_a_multilayer_context() -> None:
    (context,) = make_contexts(
        {"exec_cxt.periodic.type": "MultilayerCompositeEC", "conf.default.members": "a, b | c,d,|"}
    )
    assert isinstance(context, MultilayerCompositeEC)
    assert context.groups == (("a", "b"), ("c", "d"))


@pytest.mark.parametrize(
    "name", ["component_exttrig_ec", "component_composite", "component_composite_member"]
)
def test_profiles_are_those_of_openrtm(name: str) -> None:
    """The properties of a component's own context, made from the component's properties, as captured."""
    captured = json.loads((VECTORS / f"{name}.json").read_text())
    properties = {p["name"]: p["value"] for p in captured["component_profile"]["properties"]}
    told = captured["owned_contexts"][0]["profile"]
    (context,) = make_contexts(properties)
    context.bind_owner(Actor(), 0)
    profile = context.profile()
    assert (profile.kind.name, profile.rate) == (told["kind"], told["rate"])
    assert profile.properties == {p["name"]: p["value"] for p in told["properties"]}
    context.close()


def test_specs_of_unknown_options_are_shown_but_not_looked_at() -> None:
    (spec,) = context_specs({"exec_cxt.periodic.colour": "blue"})
    assert make_context(spec).profile().properties == {
        "colour": "blue",
        "type": "PeriodicExecutionContext",
        "rate": "1000",
        "sync_transition": "YES",
        "transition_timeout": "0.5",
    }
