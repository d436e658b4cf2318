"""``python -m namlcp``: see `namlcp.cli`."""

import sys

from namlcp.cli import main

if __name__ == "__main__":
    sys.exit(main())
