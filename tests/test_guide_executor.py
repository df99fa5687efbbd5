"""The programs of the guide to executors do what is said of them."""

import os
import re
import subprocess
import sys

import pytest

from tests.test_guides import ROOT, programs

GUIDE = "docs/executor.md"
OUTPUTS = [
    "count 42\n",
    "woken\n",
    "Hello World!3\n3\nHello World!6\n6\n",
    "avoids 7\n",
    "on_timer, the callback of the timer of 1 ms, raised ZeroDivisionError: integer division or modulo by zero "
    "(<string>:9). The executor goes on, 1 so far.\nmoves by 5\n",
    "66\n",
]
"""What the programs print, in their order."""


@pytest.mark.parametrize("number", range(len(OUTPUTS)))
def test_a_program_prints_what_it_should(number: int) -> None:
    done = subprocess.run(
        [sys.executable, "-c", programs(GUIDE)[number]],
        capture_output=True,
        text=True,
        timeout=40,
        env=dict(os.environ),
    )
    # A machine that is busy makes callbacks late, and that is told.
    told = [line for line in done.stderr.splitlines() if "behind its let" not in line]
    assert (done.stdout, told, done.returncode) == (OUTPUTS[number], [], 0)


def test_no_program_goes_untested() -> None:
    assert len(programs(GUIDE)) == len(OUTPUTS)


def test_the_output_that_is_shown_is_that_of_the_program() -> None:
    text = (ROOT / GUIDE).read_text()
    shown = re.search(r"only with a number:\n\n```text\n(.*?)```", text, re.DOTALL)
    assert shown is not None
    assert shown[1] == OUTPUTS[2]
