"""Every example is in a guide, and the list says of none what it does not say of itself."""

import re

from tests.examples.stage import EXAMPLES, ROOT

GUIDE = (ROOT / "docs/examples.md").read_text()


def test_every_example_is_in_a_guide() -> None:
    pattern = re.compile(r"examples/(\w+)\.py")
    here = set(pattern.findall(GUIDE))
    anywhere = {name for path in (ROOT / "docs").glob("*.md") for name in pattern.findall(path.read_text())}
    there = {path.stem for path in EXAMPLES.glob("*.py")}
    assert here <= there
    assert there <= anywhere, "list it in docs/examples.md, with what it prints"


def test_what_is_printed_is_printed_by_the_example() -> None:
    rows = re.findall(r"^\| (\[.*?) \| .*? \| (`.*?`) \| (?:yes)? ?\|$", GUIDE, re.MULTILINE)
    assert len(rows) > 20
    for names, printed in rows:
        sources = "".join((EXAMPLES / f"{name}.py").read_text() for name in re.findall(r"\[(\w+)\]", names))
        for line in re.findall(r"`(.*?)`", printed):
            words = re.findall(r"[A-Za-z_/]{3,}", line)
            missing = [word for word in words if word not in sources]
            assert not missing, f"{names} does not print {line!r}"
