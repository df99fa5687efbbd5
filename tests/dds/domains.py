"""DDS domains for tests: each test has one of its own, whoever else is testing on this machine.

A domain is claimed by locking a file named after it in the system's temporary folder; the lock goes with the
claim, at the latest with the process, however it ends.
"""

import fcntl
import os
import tempfile
import time
from io import FileIO
from itertools import count
from pathlib import Path
from typing import Final, Self

__all__ = ["Domain", "free_domain"]

_DOMAINS: Final = range(1, 101)
"""Not 0, which everybody uses; the ports of domain 101 and above reach into the system's ephemeral ports."""

_next = count(os.getpid() * 7)


class Domain(int):
    """The number of a domain that is ours for as long as this object lives, or until `release`."""

    _claim: FileIO

    @classmethod
    def claimed(cls, number: int, claim: FileIO) -> Self:
        """The domain `number`, whose lock is held by the open file `claim`."""
        domain = cls(number)
        domain._claim = claim
        return domain

    def release(self) -> None:
        """Let others have it."""
        self._claim.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def free_domain(wait: float = 30.0) -> Domain:
    """Claim a domain nobody else tests in: `with free_domain() as domain:`, or keep the object.

    Waits up to `wait` seconds when all are taken, then raises TimeoutError. A domain is not handed out again
    before all others were, so that leftovers of its last use have gone.
    """
    folder = Path(tempfile.gettempdir()) / f"muros-test-domains-{os.getuid()}"
    folder.mkdir(exist_ok=True)
    end = time.monotonic() + wait
    while True:
        for _ in _DOMAINS:
            number = _DOMAINS[next(_next) % len(_DOMAINS)]
            claim = FileIO(folder / str(number), "a")
            try:
                fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                claim.close()
                continue
            return Domain.claimed(number, claim)
        if time.monotonic() > end:
            raise TimeoutError(f"all {len(_DOMAINS)} test domains are taken (locks in {folder})")
        time.sleep(0.05)
