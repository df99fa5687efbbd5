"""`python -m muros` is the command `muros`."""

import sys

from muros.cli import main

sys.exit(main())
