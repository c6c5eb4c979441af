"""A certificate as text: JSON with arrays inside, and a digest over all of it.

An array is {"dtype", "shape", "data"}: its little-endian bytes, deflated, in base64. The digest is
SHA-256 over the document without its field "sha256", written with sorted keys and no spaces.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import math
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

FORMAT, VERSION = "passpmp certificate", 1
DIGEST = "sha256"
MOST_BYTES = 1 << 28
"""No array of a certificate is larger than this; a small file may say otherwise."""
DTYPES = {"float64": "<f8", "bool": "|u1"}


class CertificateError(ValueError):
    """A file that is no certificate, or one whose numbers cannot be."""


def pack(array: np.ndarray) -> dict[str, Any]:
    """An array of float64 or bool for a document."""
    array = np.asarray(array)
    dtype = "bool" if array.dtype == np.bool_ else "float64"
    raw = np.ascontiguousarray(array, dtype=DTYPES[dtype]).tobytes()
    data = base64.b64encode(zlib.compress(raw, 6)).decode("ascii")
    return {"dtype": dtype, "shape": list(array.shape), "data": data}


def unpack(name: str, packed: Any, dtype: str, shape: tuple[int | None, ...]) -> np.ndarray:
    """The array of a document.

    Args:
        name: for the message.
        dtype: "float64" or "bool".
        shape: with None for any length.

    Raises:
        CertificateError: it is none, or of another type or shape.
    """
    try:
        given = tuple(int(n) for n in packed["shape"])
        if packed["dtype"] != dtype:
            raise CertificateError(f"{name} must be {dtype}; it is {packed['dtype']!r}")
        size = math.prod(given) * np.dtype(DTYPES[dtype]).itemsize
        if len(given) != len(shape) or any(
            n < 0 or (want is not None and n != want) for n, want in zip(given, shape, strict=True)
        ):
            raise CertificateError(f"{name} must have shape {_shape_text(shape)}; it has {given}")
        if size > MOST_BYTES:
            raise CertificateError(f"{name} claims {size} bytes; at most {MOST_BYTES} are read")
        inflate = zlib.decompressobj()
        raw = inflate.decompress(base64.b64decode(packed["data"], validate=True), size + 1)
        if len(raw) != size:
            raise CertificateError(f"{name} does not hold as many numbers as its shape says")
    except (TypeError, KeyError, ValueError, zlib.error, binascii.Error) as error:
        if isinstance(error, CertificateError):
            raise
        raise CertificateError(f"{name} is no array: {error}") from error
    array = np.frombuffer(raw, dtype=DTYPES[dtype]).reshape(given)
    return array.astype(bool) if dtype == "bool" else array.astype(np.float64)


def _shape_text(shape: tuple[int | None, ...]) -> str:
    return "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"


def digest(document: Mapping[str, Any]) -> str:
    """SHA-256 over a document, its own digest left out."""
    content = {key: value for key, value in document.items() if key != DIGEST}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def write(path: Path, document: Mapping[str, Any]) -> None:
    """Write a document with its digest; the file is there whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    signed = {**document, DIGEST: digest(document)}
    part = path.with_name(path.name + ".part")
    part.write_text(json.dumps(signed, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    part.replace(path)


def read(path: Path) -> dict[str, Any]:
    """The document of a file, its digest not yet looked at.

    Raises:
        OSError: the file cannot be read.
        CertificateError: it is no certificate, or of another version.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=_once)
    except (ValueError, RecursionError) as error:
        raise CertificateError(f"no certificate: {error}") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise CertificateError(f'no certificate: it has no "format": "{FORMAT}"')
    if document.get("version") != VERSION:
        raise CertificateError(
            f"a certificate of version {document.get('version')!r}; this verifier reads {VERSION}"
        )
    return document


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A name that is given twice could mean one thing to the digest and another to a reader."""
    names = [name for name, _ in pairs]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise ValueError(f"given twice: {', '.join(sorted(twice))}")
    return dict(pairs)
