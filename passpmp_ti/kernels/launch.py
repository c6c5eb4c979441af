"""Kernels whose launches cost little.

At each launch Taichi looks at every argument anew, in Python: with a dozen arrays that takes longer
than many of our kernels run. A `kernel` of this module is Taichi's own, and its first call with a
set of template arguments is Taichi's own call, which compiles and checks everything. Later calls
hand their arguments straight to what was compiled, after the checks that Taichi makes too: type,
dimensions, contiguity. Whatever is not as expected takes Taichi's way, and its errors are Taichi's.
What a launch hands over is kept for the next one, and NumPy arrays that are still the same are not
handed over again; so none may be given another shape in place. No launch keeps an array alive.

This leans on parts of Taichi that its public interface does not show. Where they are missing every
call takes Taichi's way.
"""

import functools
import weakref

import numpy as np
import taichi as ti
from taichi.lang import impl

MOST = 2**31 - 1
"""Elements of an array that a kernel can address."""
ARRAYS = {
    id(ti.u8): np.dtype(np.uint8),
    id(ti.u16): np.dtype(np.uint16),
    id(ti.i32): np.dtype(np.int32),
    id(ti.u32): np.dtype(np.uint32),
    id(ti.f32): np.dtype(np.float32),
    id(ti.f64): np.dtype(np.float64),
}


def kernel(function):
    """Taichi's `ti.kernel`, with launches that cost little."""
    slow = ti.kernel(function)
    primal = slow._primal
    templates, setters = _parameters(primal)
    whole = primal.return_type is None
    count = len(primal.arguments)
    ready = {}

    @functools.wraps(function)
    def launch(*args):
        if setters is None or len(args) != count:
            return slow(*args)
        key = tuple([args[place] for place in templates])
        prog = impl.get_runtime().prog
        found = ready.get(key)
        if found is None or found[0] is not prog:
            result = slow(*args)
            ready[key] = _compiled(primal, args)
            return result
        _, made, compiled, idle, on_cpu = found
        if compiled is None:
            return slow(*args)
        # taken while it is in use, so that no other thread's launch finds it
        try:
            context, held = idle.pop()
        except IndexError:
            context, held = made.make_launch_context(), [_gone] * count
        for place, slot, put, wanted in setters:
            value = args[place]
            # many arrays are those of the launch before
            if held[place]() is value and value is not None:
                continue
            if not put(context, slot, value, wanted):
                return slow(*args)
            # a launch spoils what a context says of a device's array: that is handed over each time
            held[place] = weakref.ref(value) if type(value) is np.ndarray else _gone
        prog.launch_kernel(compiled, context)
        result = None
        if not whole:
            prog.synchronize()
            result = context.get_struct_ret_int((0,))
        if on_cpu:
            idle.append((context, held))
        return result

    launch.plain = slow
    return launch


def _parameters(primal):
    """(places of template arguments, how each of the others is handed over); None: Taichi's way."""
    templates, setters = [], []
    if primal.return_type is not None and [id(t) for t in primal.return_type] != [id(ti.i32)]:
        return templates, None
    for place, argument in enumerate(primal.arguments):
        wanted = argument.annotation
        slot = (place - len(templates),)
        if isinstance(wanted, type(ti.template())):
            templates.append(place)
        elif id(wanted) == id(ti.i32):
            setters.append((place, slot, _put_int, None))
        elif id(wanted) == id(ti.u32):
            setters.append((place, slot, _put_uint, None))
        elif id(wanted) == id(ti.f32):
            setters.append((place, slot, _put_float, None))
        elif (kind := _elements(getattr(wanted, "dtype", None))) is not None:
            setters.append((place, slot, _put_array, (*kind, wanted.ndim)))
        else:
            return templates, None
    return templates, setters


def _elements(dtype):
    """(NumPy's type, shape of one element) of an array's elements; None: Taichi's way."""
    if id(dtype) in ARRAYS:
        return ARRAYS[id(dtype)], ()
    if isinstance(dtype, type(ti.types.vector(2, ti.f32))) and id(dtype.dtype) in ARRAYS:
        return ARRAYS[id(dtype.dtype)], tuple(dtype.get_shape())
    return None


def _compiled(primal, args):
    """(program, kernel, what it was compiled to, idle contexts of earlier launches with the arrays
    that each holds, whether they may be launched again); not compiled: it takes Taichi's way."""
    prog = impl.get_runtime().prog
    # debugging checks more than can be seen from here
    if impl.current_cfg().debug:
        return prog, None, None, [], False
    try:
        made = primal.compiled_kernels[primal.ensure_compiled(*args)]
        compiled = prog.compile_kernel(prog.config(), prog.get_device_caps(), made)
        # other backends may leave in a context what is true of one launch only
        return prog, made, compiled, [], prog.config().arch in (ti.x64, ti.arm64)
    except (AttributeError, KeyError, TypeError):
        return prog, None, None, [], False


def _gone():
    """Like a weak reference to an array that is gone: nothing is held."""


def _put_int(context, slot, value, _):
    if type(value) is not int:
        return False
    context.set_arg_int(slot, value)
    return True


def _put_uint(context, slot, value, _):
    if type(value) is not int:
        return False
    context.set_arg_uint(slot, value)
    return True


def _put_float(context, slot, value, _):
    if type(value) is not float:
        return False
    context.set_arg_float(slot, value)
    return True


def _put_array(context, slot, value, wanted):
    dtype, element, dimensions = wanted
    if type(value) is np.ndarray:
        shape = value.shape
        fits = value.dtype == dtype and len(shape) == dimensions + len(element)
        if not (fits and value.size <= MOST and value.flags.c_contiguous):
            return False
        if element:
            if shape[dimensions:] != element:
                return False
            shape = shape[:dimensions]
        context.set_arg_external_array_with_shape(slot, value.ctypes.data, value.nbytes, shape, 0)
        return True
    if isinstance(value, ti.Ndarray):
        # its type and dimensions were compiled for, or are told apart by Taichi
        if value.grad is not None or len(value.shape) != dimensions:
            return False
        if value.dtype is None or ARRAYS.get(id(value.dtype)) != dtype:
            return False
        if tuple(value.element_shape) != element:
            return False
        context.set_arg_ndarray(slot, value.arr)
        return True
    return False
