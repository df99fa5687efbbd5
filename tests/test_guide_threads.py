"""The programs of the guide to threads do what is said of them, with and without privileges."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.test_guides import programs

GUIDE = "docs/threads.md"
PRINTED = ["speed 3", "three ticks", "fused 0 1", "planned with ['picture', 'scan']"]
WARNING = "muros: threads run, but not all are scheduled as they should be."


def test_no_program_goes_untested() -> None:
    assert len(programs(GUIDE)) == len(PRINTED)


@pytest.mark.parametrize("number", range(len(PRINTED)))
def test_programs_print_what_is_said(number: int, tmp_path: Path) -> None:
    script = tmp_path / "program.py"
    script.write_text(programs(GUIDE)[number])
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=50, check=False, cwd=tmp_path
    )
    assert (done.returncode, done.stdout) == (0, PRINTED[number] + "\n"), done.stderr
    assert all(line.startswith(WARNING) for line in done.stderr.splitlines())
