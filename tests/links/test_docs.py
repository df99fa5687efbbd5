"""The examples of the manual run, and its table of problems is complete."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "links.md").read_text()
EXAMPLES = re.findall(r"```python\n(.*?)```", TEXT, re.S)
SOURCES = sorted((ROOT / "src" / "muros" / "links").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=range(len(EXAMPLES)))
def test_examples_run(example: str) -> None:
    exec(example, {})


def test_every_code_is_explained() -> None:
    source = "".join(path.read_text() for path in SOURCES)
    codes = set(re.findall(r'Cause\(\s*"([a-z-]+)"', source))
    assert len(codes) > 10
    table = TEXT.partition("| code |")[2].partition("\n\n")[0]
    explained = set(re.findall(r"`([a-z-]+)`", table)) - {"mtu", "connections"}
    assert explained == codes
