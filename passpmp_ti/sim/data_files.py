"""Files that a scenario names: where they lie, and walls read from line files."""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

DATA = "PASSPMP_DATA"
REPOSITORY = Path(__file__).resolve().parents[2]


def find_data(text: str, beside: Path) -> Path:
    """A path in a scenario file: `${PASSPMP_DATA}` is the folder of the recorded data, other
    variables are the environment's, and what is not absolute lies beside the file.

    Raises:
        ValueError: no such file, and where it was looked for.
    """
    default = REPOSITORY.parent / "shared" / "data"
    known = {DATA: str(default), **os.environ}
    unset = [name for name in re.findall(r"\$\{(\w+)\}", text) if name not in known]
    if unset:
        raise ValueError(f"the environment variable {unset[0]} in {text!r} is not set")
    filled = re.sub(r"\$\{(\w+)\}", lambda m: known[m[1]], text)
    path = beside.parent / filled
    if not path.is_file():
        remedy = f"; set {DATA} to the folder that holds the recorded data" if DATA in text else ""
        raise ValueError(f"{path}: no such file{remedy}")
    return path


def read_lines(path: Path) -> np.ndarray:
    """[n, 4] walls x1, y1, x2, y2 [m] of a line file.

    Either an XML file with `<Line x1= y1= x2= y2= />` elements (as OpenTraj's maps), or text with
    four numbers a line.

    Raises:
        ValueError: neither, or no line in it.
    """
    try:
        if path.suffix == ".xml":
            found = [
                [float(element.attrib[key]) for key in ("x1", "y1", "x2", "y2")]
                for element in ElementTree.parse(path).iter()
                if element.tag.split("}")[-1] == "Line"
            ]
            lines = np.array(found, dtype=np.float64).reshape(-1, 4)
        else:
            lines = np.loadtxt(path, ndmin=2)
    except (OSError, KeyError, ValueError, ElementTree.ParseError) as cause:
        raise ValueError(f"{path}: not a line file: {cause}") from cause
    if not len(lines) or lines.shape[1] != 4 or not np.isfinite(lines).all():
        raise ValueError(f"{path}: must hold lines of four finite numbers x1, y1, x2, y2 [m]")
    return lines
