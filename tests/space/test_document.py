"""What docs/space.md shows works, and its table of findings is whole."""

import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs/space.md").read_text()
PROGRAMS = re.findall(r"^```python\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
SHOWN = ["10 bytes, number 1\n", "", "1 b'24 and 42'\n", "", "Appeared\n"]


def run(program: str) -> dict[str, Any]:
    """Run a program of the document; returns its names."""
    names: dict[str, Any] = {}
    exec(compile(program, "docs/space.md", "exec"), names)
    return names


@pytest.mark.parametrize(("program", "shown"), list(zip(PROGRAMS, SHOWN, strict=True)))
def test_programs_work(program: str, shown: str, capsys: pytest.CaptureFixture[str]) -> None:
    run(program)
    assert capsys.readouterr().out == shown


def test_all_codes_of_findings_are_in_the_table() -> None:
    """Those of the engines and of the network below; the other rooms of the space have documents of their own."""
    table = set(re.findall(r"^\| `([a-z-]+)` \|", TEXT, re.MULTILINE))
    folders = ("space/*.py", "space/local/*.py", "space/dds/*.py", "rtps/net/*.py")
    source = "\n".join(path.read_text() for folder in folders for path in (ROOT / "src/muros").glob(folder))
    used = set(re.findall(r"\"([a-z]+(?:-[a-z]+)+)\"", source)) | {
        "reader-deadline-missed",
        "writer-deadline-missed",
    }
    assert table == used
