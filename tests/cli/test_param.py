"""`muros param` at a node with parameters, in one space."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from muros.rclc import Context, Executor, Parameters
from muros.rclc.host.parameter_files import fitting, read, write
from muros.rclc.parameter_errors import InvalidParameterError
from tests.cli.scene import Scene, play


def with_arm(scenario: Callable[[Scene, Parameters], Awaitable[None]]) -> None:
    """Plays a scenario in which the node /lab/arm has parameters."""

    async def main(scene: Scene) -> None:
        context = Context(scene.space)
        parameters = context.node("arm", "lab").parameters()
        parameters.declare("gain", 1.0, range=(0.0, 10.0, 0.5), description="loop gain", constraints="halves")
        parameters.declare("motor.current", 3, range=(0, 5))
        parameters.declare("fixed", b"\1\2", read_only=True)
        parameters.declare("tags", [], type=9)
        executor = Executor(context)

        async def spin() -> None:
            while True:
                executor.spin_some()
                await asyncio.sleep(0.001)

        spinning = asyncio.ensure_future(spin())
        await scenario(scene, parameters)
        spinning.cancel()
        context.close()

    play(main)


def test_list_and_get() -> None:
    async def scenario(scene: Scene, parameters: Parameters) -> None:
        scene.node("/silent")
        done = await scene.muros("param list")
        assert done.out == "/lab/arm:\n  fixed\n  gain\n  motor.current\n  tags\n"
        done = await scene.muros("param list /lab/arm --param-type --filter ^[fg]")
        assert done.out == "  fixed (type: byte array)\n  gain (type: double)\n"
        done = await scene.muros("param list lab/arm --param-prefixes motor")
        assert done.out == "  motor.current\n"
        for name, shown in (
            ("gain", "Double value is: 1.0"),
            ("motor.current", "Integer value is: 3"),
            ("fixed", "Byte values are: [1, 2]"),
            ("tags", "String values are: []"),
            ("gain --hide-type", "1.0"),
        ):
            assert (await scene.muros(f"param get /lab/arm {name}")).out == shown + "\n"
        done = await scene.muros("param get /lab/arm gian")
        assert (done.error, done.status) == ("Parameter not set: /lab/arm has no gian; did you mean gain?", 1)
        done = await scene.muros("param get /lab/amr gain --timeout 0.05")
        assert done.error == "Node not found: Unknown node '/lab/amr': did you mean /lab/arm?"
        done = await scene.muros("param get /silent gain --service-timeout 0.05")
        assert done.error.startswith("/silent has no parameters: nobody serves /silent/get_parameters")
        assert (await scene.muros("param list --filter [")).status == 2

    with_arm(scenario)


def test_set_and_delete() -> None:
    async def scenario(scene: Scene, parameters: Parameters) -> None:
        assert (await scene.muros("param set /lab/arm gain 2.5")).out == "Set parameter successful\n"
        assert parameters.get("gain") == 2.5
        done = await scene.muros("param set /lab/arm gain 3")
        assert (done.err, done.status) == ("muros: Setting parameter failed: Type mismatch\n", 1)
        done = await scene.muros("param set /lab/arm gain 3.5 tags '[a, b]' fixed 1")
        assert done.out == "gain: Set parameter successful\ntags: Set parameter successful\n"
        assert done.err == "muros: fixed: Setting parameter failed: Read only parameter\n"
        assert parameters.get("tags") == ["a", "b"]
        await scene.muros("param set /lab/arm tags []")
        assert parameters.get("tags") == []
        done = await scene.muros("param set /lab/arm --atomic gain 4.5 motor.current 9")
        assert done.err.startswith("muros: Setting parameters atomically failed: Parameter {motor.current}")
        assert parameters.get("gain") == 3.5
        assert (await scene.muros("param set /lab/arm gain")).status == 2
        done = await scene.muros("param delete /lab/arm tags")
        assert done.out == "Deleted parameter successfully\n"
        done = await scene.muros("param delete /lab/arm tags")
        assert done.error == "Deleting parameter failed: Parameter not found"

    with_arm(scenario)


def test_describe() -> None:
    async def scenario(scene: Scene, parameters: Parameters) -> None:
        assert (await scene.muros("param describe /lab/arm gain fixed")).out.splitlines() == [
            "Parameter name: gain",
            "  Type: double",
            "  Description: loop gain",
            "  Constraints:",
            "    Min value: 0.0",
            "    Max value: 10.0",
            "    Step: 0.5",
            "    Additional constraints: halves",
            "Parameter name: fixed",
            "  Type: byte array",
            "  Constraints:",
            "    Read only: true",
        ]
        done = await scene.muros("param describe /lab/arm nobody")
        assert done.error == "Parameter not set: /lab/arm has no nobody"

    with_arm(scenario)


def test_dump_and_load(tmp_path: Path) -> None:
    file = tmp_path / "arm.yaml"

    async def scenario(scene: Scene, parameters: Parameters) -> None:
        parameters.constrain("fixed", read_only=False)
        file.write_text((await scene.muros("param dump /lab/arm")).out)
        parameters.update({"gain": 9.0, "motor.current": 1, "fixed": b"", "tags": ["x"]})
        done = await scene.muros(f"param load /lab/arm {file}")
        assert done.out.splitlines() == [
            f"Set parameter {name} successful" for name in ("fixed", "gain", "motor.current", "tags")
        ]
        assert [parameters.get(name) for name in parameters.list()] == [b"\1\2", 1.0, 3, []]
        file.write_text("/**:\n  ros__parameters: {gain: 2, nobody: 1}\n")
        done = await scene.muros(f"param load /lab/arm {file}")
        assert done.out == "Set parameter gain successful\n"
        assert (done.err, done.status) == ("muros: Set parameter nobody failed: Parameter not found\n", 1)
        assert parameters.get("gain") == 2.0
        done = await scene.muros(f"param load /lab/arm {file} --no-use-wildcard")
        assert done.error == f"{file} has no parameters for /lab/arm, only for /**"

    with_arm(scenario)


def test_files_of_parameters() -> None:
    text = """
    /**: {ros__parameters: {a: 1, b: 1}}
    /lab/*: {ros__parameters: {b: 2}}
    lab: {arm: {ros__parameters: {c: {d: 3}, e.f: [1.5]}}}
    other: {ros__parameters: {a: 9}}
    """
    assert read(text, "/lab/arm") == {"a": 1, "b": 2, "c.d": 3, "e.f": [1.5]}
    assert read(text, "/lab/arm", wildcard=False) == {"c.d": 3, "e.f": [1.5]}
    assert read(text, "/a/b/c") == {"a": 1, "b": 1}
    assert read(write("/n", {"a": 1, "a.b": True, ".x": "", "y.": b"a"}), "/n") == {
        "a": 1,
        "a.b": True,
        ".x": "",
        "y.": [97],
    }
    assert [fitting(2, 3), fitting([2], 8), fitting([2], 5), fitting([256], 5), fitting(True, 3)] == [
        2.0,
        [2.0],
        b"\2",
        [256],
        True,
    ]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("a: [", "the file is no YAML: "),
        ("", "names no node"),
        ("- 1", "names no node"),
        ("/n: 1", "/n has no ros__parameters"),
        ("/n: {ros__parameters: 3}", "ros__parameters of /n has no names in it"),
        ("/n: {ros__parameters: {a: }}", "parameter a has no value"),
        ("/m: {ros__parameters: {a: 1}}", "the file has no parameters for /n, only for /m"),
        ("{}", "only for nobody"),
    ],
)
def test_files_that_are_none(text: str, why: str) -> None:
    with pytest.raises(InvalidParameterError, match=why):
        read(text, "/n")
