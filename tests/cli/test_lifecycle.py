"""`muros lifecycle`: what it prints is what `ros2 lifecycle` prints."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

import pytest

from muros.rclc import Context, Executor
from tests.cli.scene import Scene, play

STATE = "lifecycle_msgs/srv/GetState"

Scenario = Callable[[Scene, Any], Awaitable[None]]


def with_camera(scenario: Scenario, **callbacks: Any) -> None:
    """Runs a scenario beside a managed node /lab/camera and a hidden one."""

    async def main(scene: Scene) -> None:
        context = Context(scene.space)
        context.on_problem(lambda code, text: None)
        lifecycle = context.node("camera", "lab").lifecycle(**callbacks)
        context.node("_hidden").lifecycle()
        executor = Executor(context)

        async def spin() -> None:
            while True:
                executor.spin_some()
                await asyncio.sleep(0.001)

        spinning = asyncio.ensure_future(spin())
        try:
            await scenario(scene, lifecycle)
        finally:
            spinning.cancel()
            with suppress(asyncio.CancelledError):
                await spinning
            context.close()

    play(main)


def test_nodes() -> None:
    async def scenario(scene: Scene, camera: Any) -> None:
        scene.node("/plain")
        assert (await scene.muros("lifecycle nodes")).out == "/lab/camera\n"
        assert (await scene.muros("lifecycle nodes -a")).out == "/_hidden\n/lab/camera\n"
        assert (await scene.muros("lifecycle nodes -c")).out == "1\n"

    with_camera(scenario)


def test_get() -> None:
    async def scenario(scene: Scene, camera: Any) -> None:
        assert (await scene.muros("lifecycle get /lab/camera")).out == "unconfigured [1]\n"
        camera.configure()
        assert (await scene.muros("lifecycle get lab/camera")).out == "inactive [2]\n"
        assert (await scene.muros("lifecycle get")).out == "/lab/camera: inactive [2]\n"
        assert (await scene.muros("lifecycle get -a")).out == (
            "/_hidden: unconfigured [1]\n/lab/camera: inactive [2]\n"
        )

    with_camera(scenario)


def test_list() -> None:
    async def scenario(scene: Scene, camera: Any) -> None:
        assert (await scene.muros("lifecycle list /lab/camera")).out == (
            "- configure [1]\n\tStart: unconfigured\n\tGoal: configuring\n"
            "- shutdown [5]\n\tStart: unconfigured\n\tGoal: shuttingdown\n"
        )
        everything = (await scene.muros("lifecycle list /lab/camera -a")).out
        assert everything.count("\n- ") == 24
        assert everything.endswith("- transition_error [62]\n\tStart: errorprocessing\n\tGoal: finalized\n")

    with_camera(scenario)


def test_set() -> None:
    async def scenario(scene: Scene, camera: Any) -> None:
        done = await scene.muros("lifecycle set /lab/camera configure")
        assert (done.out, done.error, done.status) == ("Transitioning successful\n", "", 0)
        assert camera.state == "inactive"
        done = await scene.muros("lifecycle set /lab/camera 3")
        assert (done.out, camera.state) == ("Transitioning successful\n", "active")
        done = await scene.muros("lifecycle set /lab/camera deactivate")
        assert (done.out, done.error, done.status) == ("", "Transitioning failed", 1)
        done = await scene.muros("lifecycle set /lab/camera configure")
        assert done.error == (
            "Unknown transition requested, available ones are:\n- deactivate [4]\n- shutdown [7]"
        )
        await scene.muros("lifecycle set /lab/camera shutdown")
        done = await scene.muros("lifecycle set /lab/camera shutdown")
        assert (done.error, done.status) == (
            "Unknown transition requested, available ones are: none",
            1,
        )

    with_camera(scenario, on_deactivate=lambda: False)


@pytest.mark.parametrize("words", ["get /plain", "list /plain", "set /plain configure"])
def test_a_node_that_is_not_managed(words: str) -> None:
    async def scenario(scene: Scene, camera: Any) -> None:
        scene.node("/plain")
        done = await scene.muros(f"lifecycle {words}")
        assert done.error == "/plain is no managed node: nobody serves /plain/get_state"

    with_camera(scenario)


def test_a_node_that_is_not_there() -> None:
    async def scenario(scene: Scene, camera: Any) -> None:
        done = await scene.muros("lifecycle get /lab/camara")
        assert done.error == "Unknown node '/lab/camara': did you mean /lab/camera?"

    with_camera(scenario)


def test_nodes_that_do_not_answer() -> None:
    """Those of the C library offer services that nobody serves."""

    async def scenario(scene: Scene) -> None:
        scene.server("/deaf", "/deaf/get_state", STATE, lambda request: 1 / 0)
        done = await scene.muros("lifecycle get /deaf --timeout 0.05")
        assert (done.out, done.error) == ("", "no answer from /deaf/get_state within 0.05 s")
        done = await scene.muros("lifecycle get --timeout 0.05")
        assert (done.err, done.status) == ("muros: no answer from /deaf/get_state within 0.05 s\n", 1)
        done = await scene.muros("lifecycle list /deaf --timeout 0.05")
        assert done.error == "nobody serves /deaf/get_available_transitions"

    play(scenario)
