"""A missing runtime is said aloud, and never lets continuous integration pass."""

import pytest

from tests.micropython import runtimes


@pytest.fixture
def nothing_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runtimes, "_lacking", lambda runtime: "not installed")


@pytest.mark.usefixtures("nothing_installed")
def test_a_missing_runtime_skips_the_test(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CI", raising=False)
    with pytest.raises(pytest.skip.Exception, match=r"'gauge': not installed .*setup\.sh"):
        runtimes.require("gauge")


@pytest.mark.usefixtures("nothing_installed")
def test_a_missing_runtime_fails_continuous_integration(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CI", "true")
    with pytest.raises(pytest.fail.Exception, match="'gauge': not installed"):
        runtimes.require("gauge")


def test_an_unknown_runtime_is_a_mistake() -> None:
    with pytest.raises(ValueError, match="unknown runtime 'arduino'"):
        runtimes.require("arduino")
