"""What follows when a callback is later than its let, or raises. Boards borrow this."""

GO_ON = 1
"""An error of a callback, or an overrun, is counted and told, nothing else."""

CANCEL_CURRENT = 2
"""After an overrun the callbacks that the period has yet to call are not called; what the others published leaves."""

CANCEL_WITHOUT_OUTPUT = 3
"""The same, and nothing that was published in this period leaves."""

CANCEL_NEXT = 4
"""After an overrun the period goes on to its end, and the next one is left out."""

LOW_PRIORITY = 5
"""A callback that overruns goes on beside the others with low priority; only on hosts."""
