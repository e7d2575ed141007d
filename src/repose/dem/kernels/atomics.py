"""A barrier for threads that run a kernel each: counters that LLVM changes by atomic instructions."""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .jit import inlined

INT32, INT64 = ir.IntType(32), ir.IntType(64)
ARRIVED, ROUND = 0, 8  # places of the two counters of a barrier, a cache line apart
BARRIER_SIZE = 16
PATIENCE = 4000  # reads of the counter before the processor is offered to others


def _place(context, builder, signature, values):
    """Pointer to element values[1] of the array values[0]."""
    array = context.make_array(signature.args[0])(context, builder, values[0])
    index = context.cast(builder, values[1], signature.args[1], types.int64)
    return builder.gep(array.data, [index])


def _is_counter(array):
    return isinstance(array, types.Array) and array.dtype == types.int64


@intrinsic
def atomic_add(typingctx, array, index, value):
    """Add to an element of an int64 array; returns its value before."""

    def generate(context, builder, sig, values):
        value = context.cast(builder, values[2], sig.args[2], types.int64)
        return builder.atomic_rmw(
            "add", _place(context, builder, sig, values), value, "seq_cst"
        )

    return (types.int64(array, index, value), generate) if _is_counter(array) else None


@intrinsic
def atomic_load(typingctx, array, index):
    """Read an element of an int64 array that another thread may write."""

    def generate(context, builder, sig, values):
        return builder.load_atomic(_place(context, builder, sig, values), "seq_cst", 8)

    return (types.int64(array, index), generate) if _is_counter(array) else None


@intrinsic
def offer_processor(typingctx):
    """Let another thread of the machine run (POSIX sched_yield)."""

    def generate(context, builder, sig, values):
        function = ir.FunctionType(INT32, [])
        name = "sched_yield"
        known = builder.module.globals.get(name)
        builder.call(known or ir.Function(builder.module, function, name), [])
        return context.get_dummy_value()

    return types.void(), generate


@inlined
def wait_for_all(counters, threads):
    """Wait until all threads have called it."""
    if threads == 1:
        return
    this_round = atomic_load(counters, ROUND)
    if atomic_add(counters, ARRIVED, 1) == threads - 1:
        atomic_add(counters, ARRIVED, -threads)
        atomic_add(counters, ROUND, 1)
        return
    looks = 0
    while atomic_load(counters, ROUND) == this_round:
        looks += 1
        if looks > PATIENCE:
            offer_processor()
