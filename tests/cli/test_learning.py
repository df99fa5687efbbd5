"""Types that nodes tell: taken when the hash is right, and only then."""

import asyncio
from dataclasses import replace
from typing import Any

import pytest

from muros import interfaces
from muros.cli import _learn
from muros.interfaces._hashes import rihs01
from tests.cli.scene import Scene, play

GIVE = interfaces.service(_learn.DESCRIBE)
Source = interfaces.message("type_description_interfaces/msg/TypeSource")


def hash_of(tmp_path: Any, sources: dict[str, str]) -> str:
    """The hash of the first of these definitions."""
    for name, text in sources.items():
        package, kind, plain = name.split("/")
        (tmp_path / package / kind).mkdir(parents=True, exist_ok=True)
        (tmp_path / package / kind / f"{plain}.{kind}").write_text(text)
    registry = interfaces.Registry()
    registry.add_path(tmp_path)
    return rihs01(registry, next(iter(sources)))


async def asked(scene: Scene, name: str, type_hash: str, answer: Any) -> bool:
    """Whether a type is learned from a node that gives this answer."""
    seen: list[Any] = []

    def give(request: Any) -> Any:
        seen.append(request)
        return answer

    scene.server("/teller", "/teller/get_type_description", _learn.DESCRIBE, give)
    scene.writer("/teller", "/x", name)
    (endpoint,) = [w for w in scene.space.graph.writers if w.topic == "rt/x"]
    command = scene.start("topic list")
    learned = await _learn.learn(command.tool, name, [replace(endpoint, type_hash=type_hash)])
    await command.end()
    if seen:
        assert (seen[0].type_name, seen[0].type_hash, seen[0].include_type_sources) == (name, type_hash, True)
    return learned


def answer_of(sources: dict[str, str]) -> Any:
    return GIVE.Response(
        successful=True,
        type_sources=[
            Source(type_name=n, encoding=n.split("/")[1], raw_file_contents=t) for n, t in sources.items()
        ],
    )


def test_a_definition_with_the_right_hash_is_taken(tmp_path_factory: pytest.TempPathFactory) -> None:
    sources = {"told_msgs/msg/Outer": "Inner inner\nint32 number\n", "told_msgs/msg/Inner": "string text\n"}
    right = hash_of(tmp_path_factory.mktemp("told"), sources)

    async def scenario(scene: Scene) -> None:
        assert not interfaces.known("told_msgs/msg/Outer")
        assert await asked(scene, "told_msgs/msg/Outer", right, answer_of(sources))
        assert interfaces.message("told_msgs/msg/Outer")(number=5).number == 5

    play(scenario)


@pytest.mark.parametrize(
    "sources",
    [
        {},
        {"liar_msgs/msg/A": "int32 other\n"},
        {"liar_msgs/msg/A": "no such thing\n"},
        {"liar_msgs/msg/B": "int32 data\n"},
        {"../../etc/msg/A": "int32 data\n"},
        {"liar_msgs/msg/A": "liar_msgs/Missing m\n"},
    ],
)
def test_what_is_not_what_was_announced_is_not_taken(
    sources: dict[str, str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    right = hash_of(tmp_path_factory.mktemp("liar"), {"liar_msgs/msg/A": "int32 data\n"})

    async def scenario(scene: Scene) -> None:
        assert not await asked(scene, "liar_msgs/msg/A", right, answer_of(sources))
        assert not interfaces.known("liar_msgs/msg/A")

    play(scenario)


def test_a_node_that_does_not_know_or_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_learn, "ANSWER_TIME", 0.02)

    async def scenario(scene: Scene) -> None:
        assert not await asked(scene, "mute_msgs/msg/A", "RIHS01_00", GIVE.Response(failure_reason="no"))
        scene.nodes.pop("/teller").close()
        await asyncio.sleep(0)
        command = scene.start("topic list")
        assert not await _learn.learn(command.tool, "mute_msgs/msg/A", [])
        await command.end()

    play(scenario)
