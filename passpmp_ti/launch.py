"""Launches of kernels that are compiled already.

Taichi looks at each argument of each launch anew, which takes longer than a small kernel runs.
Where all arrays are NumPy's, whose types the first launch has seen, the rest of the way is short:
set the arguments, launch. It leads through parts of Taichi that are not declared, so where any of
them is missing, the launch is Taichi's own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


class Launch:
    """A kernel without a result, launched with arguments of the same types again and again."""

    def __init__(self, kernel: Callable[..., None], templates: int) -> None:
        """`templates`: how many of its arguments, the first ones, are compile-time constants."""
        self._kernel = kernel
        self._templates = templates
        self._compiled: dict[tuple[Any, ...], Any] = {}

    def __call__(self, *args: Any) -> None:
        constants, values = args[: self._templates], args[self._templates :]
        types = tuple(
            [(v.dtype.char, v.ndim) if isinstance(v, np.ndarray) else type(v) for v in values]
        )
        key = (constants, types)
        found = self._compiled.get(key)
        if found is None or not found.holds():
            self._kernel(*args)
            if all(t is int or isinstance(t, tuple) for t in types):
                self._compiled[key] = _Compiled.of(self._kernel, args)
            return
        found(values)


class _Compiled:
    """What Taichi made of a kernel for some constants and types."""

    def __init__(self, runtime: Any, program: Any, kernel: Any, data: Any) -> None:
        self._runtime, self._program = runtime, program
        self._kernel, self._data = kernel, data

    @classmethod
    def of(cls, kernel: Any, args: tuple[Any, ...]) -> _Compiled | None:
        """None: this is not the Taichi that this module knows."""
        try:
            from taichi.lang import impl

            primal = kernel._primal
            made = primal.compiled_kernels[primal.ensure_compiled(*args)]
            program = impl.get_runtime().prog
            data = program.compile_kernel(program.config(), program.get_device_caps(), made)
            context = made.make_launch_context()
        except (AttributeError, ImportError, KeyError, TypeError):
            return None
        setters = ("set_arg_external_array_with_shape", "set_arg_int")
        if not all(hasattr(context, name) for name in setters):
            return None
        return cls(impl.get_runtime(), program, made, data)

    def holds(self) -> bool:
        """Whether Taichi was not started anew since."""
        return self._runtime.prog is self._program

    def __call__(self, values: tuple[Any, ...]) -> None:
        context = self._kernel.make_launch_context()
        for n, value in enumerate(values):
            if isinstance(value, np.ndarray):
                if not value.flags.c_contiguous:
                    raise ValueError(f"argument {n} is not contiguous; pass np.ascontiguousarray")
                context.set_arg_external_array_with_shape(
                    (n,), value.__array_interface__["data"][0], value.nbytes, value.shape, 0
                )
            else:
                context.set_arg_int((n,), value)
        self._program.launch_kernel(self._data, context)
