"""What is done of a comparison, on disk: one line an episode, written as it ends."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Generator, Iterable, Mapping
from pathlib import Path
from typing import IO, Any, Protocol, TypeVar

from passpmp_ti.compare.job import Key, Result, key_of

EPISODES, CONDITIONS = "episodes.jsonl", "conditions.json"


class Keyed(Protocol):
    """What can be done, and is told from the rest by its key."""

    @property
    def key(self) -> Key:
        """(scenario, variant, seed)."""


J = TypeVar("J", bound=Keyed)


class Ledger:
    """The episodes of a folder. A process that is killed loses only what it was about to write."""

    def __init__(self, folder: Path, conditions: Mapping[str, Any]) -> None:
        """Open a folder, or begin one.

        Args:
            folder: made where it does not exist.
            conditions: what the episodes have in common, in plain JSON. Scenarios, variants and
                seeds may be added to a folder; what was said of one before must still hold.

        Raises:
            ValueError: the folder holds episodes that were driven under other conditions.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self._file: IO[str] | None = None
        self._path = folder / EPISODES
        known = folder / CONDITIONS
        merged = dict(conditions)
        if known.exists():
            merged = _merged(json.loads(known.read_text(encoding="utf-8")), conditions, folder)
        _replace(known, json.dumps(merged, indent=2) + "\n")
        self.results: dict[Key, Result] = {}
        """All episodes, those of earlier runs first."""
        if self._path.exists():
            text = self._path.read_text(encoding="utf-8")
            whole = text[: text.rfind("\n") + 1]
            if whole != text:  # the last line was cut short
                os.truncate(self._path, len(whole.encode()))
            self.results = {key_of(r): r for r in map(json.loads, whole.splitlines())}

    def done(self, key: Key) -> bool:
        """Whether an episode was driven to its end; one that raised is tried again."""
        return key in self.results and self.results[key]["error"] is None

    def add(self, found: Result) -> None:
        """Write an episode; it is on the disk when this returns."""
        if self._file is None:
            self._file = self._path.open("a", encoding="utf-8")
        self._file.write(json.dumps(found) + "\n")
        self._file.flush()
        os.fsync(self._file.fileno())
        self.results[key_of(found)] = found

    def fill(
        self,
        jobs: Iterable[J],
        each: Callable[[list[J]], Generator[Result, None, None]],
        on_result: Callable[[Mapping[Key, Result]], None],
    ) -> None:
        """Have done what is not done yet, and close the file.

        Args:
            jobs: what is wanted.
            each: does what is left of it.
            on_result: shown all results so far, those of earlier runs too, after each.

        Raises:
            KeyboardInterrupt: Ctrl-C; what is finished is written.
        """
        left = [job for job in jobs if not self.done(job.key)]
        try:
            with contextlib.closing(each(left)) as found:
                for result in found:
                    self.add(result)
                    on_result(self.results)
        finally:
            self.close()

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None


def _merged(known: Mapping[str, Any], wanted: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Conditions of both, where they do not contradict each other."""
    merged = dict(known)
    for name, value in wanted.items():
        now = known.get(name)
        if isinstance(value, dict) and isinstance(now, dict) and name in ADDED_TO:
            merged[name] = {
                **now,
                **{k: _same(f"{name}.{k}", now.get(k, v), v, folder) for k, v in value.items()},
            }
        else:
            merged[name] = _same(name, now, value, folder)
    return merged


ADDED_TO = ("scenarios", "variants")
"""Conditions that are lists by name, to which a later run may add."""


def _same(name: str, known: Any, wanted: Any, folder: Path) -> Any:
    if known != wanted:
        raise ValueError(
            f"--out {folder} holds episodes with {name} = {_short(known)}; asked for is"
            f" {_short(wanted)}. Choose another --out, or ask for what the folder holds"
        )
    return wanted


def _short(value: Any) -> str:
    told = json.dumps(value)
    return told if len(told) <= 60 else told[:57] + "..."


def _replace(path: Path, text: str) -> None:
    """Write a file so that it is there whole or not at all."""
    beside = path.with_suffix(".new")
    beside.write_text(text, encoding="utf-8")
    os.replace(beside, path)
