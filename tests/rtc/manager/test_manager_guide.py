"""docs/rtc-manager.md: its programs run, its table of keys is that of the program."""

import os
import re
import subprocess
import sys
from pathlib import Path

from muros.rtc.manager._defaults import DEFAULTS

GUIDE = (Path(__file__).parents[3] / "docs" / "rtc-manager.md").read_text()


def test_programs_run(tmp_path: Path) -> None:
    printed = []
    for program in re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL):
        done = subprocess.run(
            [sys.executable, "-c", program],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            timeout=30,
            env={**os.environ, "OMNIORB_CONFIG": os.devnull},
        )
        assert (done.returncode, done.stderr) == (0, "")
        printed.append(done.stdout)
    assert printed == ["Left is there\n2.5\n", "True\n"]


def test_the_table_has_all_keys_with_their_defaults() -> None:
    table = GUIDE.partition("## All keys")[2]
    said = {}
    for keys, default in re.findall(r"^\| (`.*`) \| ?(.*?) ?\|$", table, re.MULTILINE):
        for key in re.findall(r"`([^`]+)`", keys):
            said[key] = default.strip("`")
    assert said == DEFAULTS
