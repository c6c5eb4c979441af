"""Who stands beside our kernels in a run: C++ where it is at hand, Numba where it is installed."""

from __future__ import annotations

import importlib
import importlib.util
from types import ModuleType

from passpmp_ti.bench.found import Options
from passpmp_ti.bench.limit import Limit

OURS = "ours"
NUMPY, NUMBA = "NumPy", "Numba"
CPP, CPP_SCALAR, CPP_VECTORS = "C++", "C++ scalar", "C++ AVX-512"


def numba_module(name: str, options: Options) -> ModuleType | None:
    """One of this package's modules that need Numba; None: it is not installed."""
    if importlib.util.find_spec("numba") is None:
        return None
    importlib.import_module("passpmp_ti.bench.compiled").set_threads(options.threads)
    return importlib.import_module(f"passpmp_ti.bench.{name}")


def limit(options: Options) -> Limit | None:
    """The C++; None: no folder was given."""
    return None if options.limit is None else Limit(options.limit, options.threads)


def missing(options: Options) -> list[str]:
    """Notes about who is not there."""
    notes = []
    if options.limit is None:
        notes.append("no C++ beside it: --limit DIR names its folder")
    if importlib.util.find_spec("numba") is None:
        notes.append("no Numba beside it: pip install 'passpmp_ti[bench]'")
    return notes
