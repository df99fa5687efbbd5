"""What the documents promise holds: links lead somewhere, commands exist, changelog fragments are well-formed."""

import re
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FRAGMENT = re.compile(r"(?:\+[a-z0-9-]+|\d+)\.(\w+)(?:\.\d+)?\.md")

_DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "changelog.d" / "README.md"])


@pytest.mark.parametrize("path", _DOCUMENTS, ids=[str(path.relative_to(ROOT)) for path in _DOCUMENTS])
def test_links_lead_somewhere(path: Path) -> None:
    broken = []
    for target, anchor in links(path.read_text()):
        document = (path.parent / target).resolve() if target else path
        if not document.exists():
            broken.append(target)
        elif anchor and document.suffix == ".md" and anchor not in anchors(document.read_text()):
            broken.append(f"{target}#{anchor}")
    assert not broken, f"{path.relative_to(ROOT)} links to what is not there: {broken}"


@pytest.mark.parametrize("path", _DOCUMENTS, ids=[str(path.relative_to(ROOT)) for path in _DOCUMENTS])
def test_make_targets_in_documents_exist(path: Path) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    mentioned = set(re.findall(r"(?:^|`|\$ )make ([a-z-]+)", path.read_text(), re.MULTILINE))
    assert mentioned <= targets


def test_changelog_fragments_are_well_formed() -> None:
    towncrier = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["towncrier"]
    kinds = {kind["directory"] for kind in towncrier["type"]}
    for path in (ROOT / "changelog.d").iterdir():
        if path.name == "README.md":
            continue
        match = FRAGMENT.fullmatch(path.name)
        assert match, f"changelog.d/{path.name}: name it +<slug>.<kind>.md or <issue>.<kind>.md"
        assert match[1] in kinds, f"changelog.d/{path.name}: kind {match[1]!r} is none of {sorted(kinds)}"
        assert path.read_text().strip(), f"changelog.d/{path.name} says nothing"


def test_makefile_explains_every_target() -> None:
    text = (ROOT / "Makefile").read_text()
    phony = re.search(r"^\.PHONY: (.*)$", text, re.MULTILINE)
    assert phony is not None
    helped = subprocess.run(
        ["make", "help"], cwd=ROOT, capture_output=True, text=True, timeout=30, check=True
    )
    assert set(re.findall(r"make ([a-z-]+)", helped.stdout)) == set(phony[1].split())


def test_links_and_anchors_are_found() -> None:
    text = "# A `b` C!\n[x](docs/y.md#part) ![i](p.png) [z](#a-b-c) [w](https://example.org/q)\n```\n[no](n.md)\n```\n"
    assert links(text) == [("docs/y.md", "part"), ("p.png", ""), ("", "a-b-c")]
    assert anchors(text) == {"a-b-c"}


def links(text: str) -> list[tuple[str, str]]:
    """The links of a Markdown text that lead to files, as (path, anchor); code is no text."""
    prose = re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL))
    targets = re.findall(r"\]\(([^)\s]+)\)", prose)
    parts = [target.partition("#") for target in targets if not re.match(r"[a-z]+:", target)]
    return [(path, anchor) for path, _, anchor in parts]


def anchors(text: str) -> set[str]:
    """The anchors that the headings of a Markdown text make."""
    headings = re.findall(
        r"^#+ (.+)$", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL), re.MULTILINE
    )
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in headings}
