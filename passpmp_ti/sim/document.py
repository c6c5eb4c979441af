"""A YAML file read key by key, so that every problem in it is told at once, with its line."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import yaml

from passpmp_ti import door

T = TypeVar("T")
REQUIRED: Any = object()
"""Stands for a default where there is none."""


class Document:
    """A YAML file whose root is a mapping, and what is wrong with it."""

    def __init__(self, path: Path, owner: str = "scenario") -> None:
        """Read a file.

        Args:
            path: the file.
            owner: what its own fields are said to be of.

        Raises:
            ValueError: it cannot be read, is not YAML, or is not a mapping.
        """
        self.path = path
        self.owner = owner
        self.problems: list[tuple[int, str]] = []
        try:
            node = yaml.compose(path.read_text(encoding="utf-8"), Loader=yaml.SafeLoader)
        except OSError as cause:
            raise ValueError(f"{path}: cannot be read: {cause.strerror}") from cause
        except UnicodeDecodeError as cause:
            raise ValueError(f"{path}: must be UTF-8 text: {cause}") from cause
        except yaml.MarkedYAMLError as cause:
            line = cause.problem_mark.line + 1 if cause.problem_mark else 1
            raise ValueError(f"{path}:{line}: not YAML: {cause.problem}") from cause
        except yaml.YAMLError as cause:
            raise ValueError(f"{path}: not YAML: {cause}") from cause
        except RecursionError as cause:
            raise ValueError(f"{path}: too deep: hundreds of values within each other") from cause
        if not isinstance(node, yaml.MappingNode):
            raise ValueError(f"{path}:1: must be a mapping of keys to values; got something else")
        self.root = Section(self, node, "")

    def blame(self, line: int, problem: object) -> None:
        """Note a problem for `finish`."""
        self.problems.append((line, str(problem)))

    def finish(self) -> None:
        """Refuse the file if anything is wrong with it.

        Raises:
            ValueError: every problem with its line, in order.
        """
        if self.problems:
            lines = [f"{self.path}:{line}: {text}" for line, text in sorted(self.problems)]
            raise ValueError("\n".join(lines))


class Section:
    """A mapping in a `Document`; what is never asked for is an unknown key."""

    def __init__(self, document: Document, node: yaml.MappingNode, name: str) -> None:
        self.document = document
        self.name = name
        self.line = node.start_mark.line + 1
        self._keys: dict[str, tuple[yaml.Node, yaml.Node]] = {}
        self._asked: list[str] = []
        for key, value in node.value:
            text = str(key.value)
            if text in self._keys:
                self._blame(key, f"{self._full(text)} is given twice")
            self._keys[text] = (key, value)

    def __contains__(self, key: str) -> bool:
        return key in self._keys

    @property
    def keys(self) -> list[str]:
        """The keys that the file gives."""
        return list(self._keys)

    def line_of(self, key: str) -> int:
        """Line of a key, or of the section where it is missing."""
        return self._keys[key][0].start_mark.line + 1 if key in self._keys else self.line

    def take(self, key: str, check: Callable[[Any], Any], default: Any = REQUIRED) -> Any:
        """The value of a key, passed through `check`, which raises ValueError at a bad one.

        A problem is noted and the default (or None) stands in, so that reading can go on.
        """
        self._asked.append(key)
        fallback = None if default is REQUIRED else default
        if key not in self._keys:
            if default is REQUIRED:
                self.document.blame(self.line, f"{self._full(key)} is missing")
            return fallback
        try:
            return check(_plain(self._keys[key][1]))
        except ValueError as problem:
            self._blame(self._keys[key][0], problem)
            return fallback

    def number(self, key: str, default: Any = REQUIRED, **limits: Any) -> float:
        """A finite number; limits as for `door.finite`."""
        return self.take(key, lambda v: door.finite(self._owner, key, v, **limits), default)

    def whole(self, key: str, default: Any = REQUIRED, **limits: Any) -> int:
        """A whole number; limits as for `door.whole`."""
        return self.take(key, lambda v: door.whole(self._owner, key, v, **limits), default)

    def choice(self, key: str, options: Iterable[str], default: Any = REQUIRED) -> str:
        """One of the options."""
        return self.take(key, lambda v: door.choice(self._owner, key, v, options), default)

    def text(self, key: str, default: Any = REQUIRED) -> str:
        """A text."""
        return self.take(key, lambda v: self._of_kind(key, v, str, "a text"), default)

    def flag(self, key: str, default: Any = REQUIRED) -> bool:
        """true or false."""
        return self.take(key, lambda v: self._of_kind(key, v, bool, "true or false"), default)

    def array(self, key: str, shape: tuple[int | None, ...], default: Any = REQUIRED) -> Any:
        """An array of numbers of a shape, as for `door.array`."""
        return self.take(key, lambda v: door.array(self._owner, key, v, shape), default)

    def section(self, key: str) -> Section | None:
        """A mapping within; None where the key is missing or something else."""
        self._asked.append(key)
        if key not in self._keys:
            return None
        head, node = self._keys[key]
        if isinstance(node, yaml.MappingNode):
            return Section(self.document, node, self._full(key))
        self._blame(head, f"{self._full(key)} must be a mapping of keys to values")
        return None

    def sections(self, key: str) -> list[Section]:
        """A list of mappings within; empty where the key is missing or something else."""
        self._asked.append(key)
        if key not in self._keys:
            return []
        head, node = self._keys[key]
        items = node.value if isinstance(node, yaml.SequenceNode) else [node]
        if not all(isinstance(item, yaml.MappingNode) for item in items):
            self._blame(head, f"{self._full(key)} must be a list of mappings")
            return []
        return [
            Section(self.document, item, f"{self._full(key)}[{n}]") for n, item in enumerate(items)
        ]

    def items(self) -> list[tuple[str, Any, int]]:
        """(key, value, line) of all that is there; all of it counts as asked for."""
        self._asked.extend(self._keys)
        found = []
        for key, (head, node) in self._keys.items():
            try:
                found.append((key, _plain(node), head.start_mark.line + 1))
            except ValueError as problem:
                self._blame(head, f"{self._full(key)}: {problem}")
        return found

    def finish(self) -> None:
        """Note every key that was never asked for, with the nearest that is allowed."""
        for key, (head, _) in self._keys.items():
            if key not in self._asked:
                where = f" in {self.name}" if self.name else ""
                self._blame(
                    head,
                    f"unknown key {key!r}{where}{door.nearest(key, self._asked)};"
                    f" allowed: {', '.join(sorted(set(self._asked)))}",
                )

    @property
    def _owner(self) -> str:
        return self.name or self.document.owner

    def _full(self, key: str) -> str:
        return f"{self.name}.{key}" if self.name else key

    def _of_kind(self, key: str, value: Any, kind: type[T], words: str) -> T:
        if not isinstance(value, kind):
            raise ValueError(f"{self._full(key)} must be {words}; got {value!r}")
        return value

    def _blame(self, node: yaml.Node, problem: object) -> None:
        self.document.blame(node.start_mark.line + 1, problem)


def _plain(node: yaml.Node) -> Any:
    """The Python value of a node."""
    constructor = yaml.constructor.SafeConstructor()
    try:
        return constructor.construct_document(node)
    except (yaml.YAMLError, ValueError, TypeError, AttributeError, LookupError) as cause:
        # a tag, as `!!bool maybe`, has PyYAML raise all of these
        raise ValueError(f"not a plain value: {cause}") from cause
