"""`python -m passpmp_verify FILE...`: check certificates."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from passpmp_verify.document import CertificateError
from passpmp_verify.verify import verify_file

SAFE, NOT_SAFE, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit codes."""


def check(files: Sequence[str]) -> int:
    """Print a verdict for each file; the worst one's exit code."""
    code = SAFE
    for name in files:
        try:
            verdict = verify_file(Path(name))
        except (CertificateError, OSError) as error:
            said = error.strerror if isinstance(error, OSError) and error.strerror else error
            print(f"{name}: error: {said}", file=sys.stderr)
            code = BAD_INPUT
            continue
        print(f"{name}: {verdict.told()}", flush=True)
        code = max(code, SAFE if verdict.safe else NOT_SAFE)
    return code


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m passpmp_verify",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Check certificates of passive safety: exit code 0 if all are safe, 1 if one"
        " is not, 2 if one cannot be read.",
        epilog="example:\n  python -m passpmp_verify out/certificates/*.json",
    )
    parser.add_argument("files", nargs="+", metavar="FILE", help="a certificate")
    try:
        return check(parser.parse_args(arguments).files)
    except KeyboardInterrupt:
        print("passpmp_verify: interrupted", file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
