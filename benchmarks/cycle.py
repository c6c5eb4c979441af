"""`passpmp bench cycle` from a checkout: python benchmarks/cycle.py [--cycles N] [--json FILE]."""

from __future__ import annotations

import sys

from passpmp_ti.cli import main

if __name__ == "__main__":
    sys.exit(main(["bench", "cycle", *sys.argv[1:]]))
