"""The programs of docs/parameters.md run, one beside the other, and do what is said of them."""

import os
import re
import subprocess
import sys
from pathlib import Path

from tests.dds.domains import free_domain

ROOT = Path(__file__).parents[1]
LIMIT = 30.0
"""Seconds for a program that ends by itself."""


def test_the_arm_and_its_tuner(tmp_path: Path) -> None:
    text = (ROOT / "docs/parameters.md").read_text()
    arm, tuner = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    command = re.search(r"^\$ (muros board copy .*?)\n```", text, re.MULTILINE | re.DOTALL)
    assert command is not None
    words = command[1].replace("\\\n", " ").replace("build/board", str(tmp_path / "board")).split()
    subprocess.run([sys.executable, "-m", *words], check=True, timeout=LIMIT, capture_output=True)
    assert (tmp_path / "board/rcl_interfaces/srv/_DescribeParameters.py").is_file()
    with free_domain() as domain:
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(int(domain)),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }
        running = subprocess.Popen(
            [sys.executable, "-c", arm], env=environment, stdout=subprocess.PIPE, text=True
        )
        try:
            assert running.stdout is not None
            assert running.stdout.readline() == "gain 1.0\n"
            asked = subprocess.run(
                [sys.executable, "-c", tuner], env=environment, capture_output=True, text=True, timeout=LIMIT
            )
            assert (asked.returncode, asked.stderr) == (0, "")
            assert asked.stdout.splitlines() == [
                "['gain', 'joints', 'motor.current']",
                "1.0 {'motor.current': 3, 'joints': ['shoulder', 'elbow']}",
                "/lab/arm refuses gain: Parameter {gain} doesn't comply with floating point range.",
                "loop gain",
                "/lab/arm:",
                "  ros__parameters:",
                "    gain: 2.5",
                "    joints:",
                "    - shoulder",
                "    - elbow",
                "    motor:",
                "      current: 3",
            ]
            told = subprocess.run(
                [sys.executable, "-m", "muros", "param", "describe", "/lab/arm", "gain"],
                env=environment,
                capture_output=True,
                text=True,
                timeout=LIMIT,
            )
            assert told.stderr == ""
            assert f"$ muros param describe /lab/arm gain\n{told.stdout}```" in text
        finally:
            running.kill()
            running.wait()
            if running.stdout is not None:
                running.stdout.close()
