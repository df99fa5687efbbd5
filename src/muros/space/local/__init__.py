"""The engine behind `local:` URLs.

Theory of operation. A `Domain` keeps a `TopicRecord` for each topic name; joining it, a writer or reader meets
everybody on the other side, and matched readers are listed at the writer. `Writer.write` appends the sample to
each of those readers' caches and queues the readers that were empty; the outermost call then tells their users.
Nothing is copied, nothing runs in the background: what needs time (deadlines, waiting requests, refused writers)
lies in one heap of timers that `Space.tick` runs.
"""

from muros.space._core import Limits
from muros.space.local._space import LocalSpace, open_local

__all__ = ["Limits", "LocalSpace", "open_local"]
