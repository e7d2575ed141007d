"""A barrier: each of several threads that run a kernel waits there for all others.

It is an array of BARRIER_SIZE int64 numbers with two counters, which LLVM changes by
atomic instructions: how many threads have arrived, and the number of the round.
"""

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .jit import inlined

INT32, INT64 = ir.IntType(32), ir.IntType(64)
# Places of the two counters, a cache line apart.
ARRIVED, ROUND = 0, 8
BARRIER_SIZE = 16
READS_BEFORE_YIELD = (
    4000  # reads of a counter before the processor is offered to others
)


def _place(context, builder, signature, values):
    """Write code for the address of an element of an array; return the pointer.

    Parameters
    ----------
    context, builder
        Numba's target context and LLVM's builder.
    signature : numba signature
        Types of the values.
    values : sequence of LLVM values
        The array and the index; further values do not count.
    """
    array = context.make_array(signature.args[0])(context, builder, values[0])
    index = context.cast(builder, values[1], signature.args[1], types.int64)
    return builder.gep(array.data, [index])


def _is_int64_array(array):
    """Return whether a numba type is that of an array of int64 numbers."""
    return isinstance(array, types.Array) and array.dtype == types.int64


@intrinsic
def atomic_add(typingctx, array, index, value):
    """Add to an element of an int64 array; return its value before.

    Reading, adding and writing are one step that no other thread can interrupt. Of
    other types of arrays the result is None, by which numba knows that no such function
    exists.
    """
    if not _is_int64_array(array):
        return None

    def generate(context, builder, sig, values):
        value = context.cast(builder, values[2], sig.args[2], types.int64)
        return builder.atomic_rmw(
            "add", _place(context, builder, sig, values), value, "seq_cst"
        )

    return types.int64(array, index, value), generate


@intrinsic
def atomic_load(typingctx, array, index):
    """Return an element of an int64 array that another thread may write."""
    if not _is_int64_array(array):
        return None

    def generate(context, builder, sig, values):
        return builder.load_atomic(_place(context, builder, sig, values), "seq_cst", 8)

    return types.int64(array, index), generate


@intrinsic
def yield_processor(typingctx):
    """Let another thread of the machine run (POSIX sched_yield)."""

    def generate(context, builder, sig, values):
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(INT32, []), "sched_yield"
        )
        builder.call(function, [])
        return context.get_dummy_value()

    return types.void(), generate


@inlined
def wait_for_all(counters, threads):
    """Wait until all threads have called this function.

    The last thread to arrive clears the counter of arrivals and begins a new round, for
    which the others wait.

    Parameters
    ----------
    counters : array (BARRIER_SIZE,) of int64
        The barrier; all threads have the same one.
    threads : int
        Number of threads.
    """
    if threads == 1:
        return
    # read the round first: after the last arrival it is the next one
    this_round = atomic_load(counters, ROUND)
    n_before = atomic_add(counters, ARRIVED, 1)
    if n_before == threads - 1:
        atomic_add(counters, ARRIVED, -threads)
        atomic_add(counters, ROUND, 1)
        return
    # wait for the next round; after many reads let other threads of the machine run
    n_reads = 0
    while atomic_load(counters, ROUND) == this_round:
        n_reads += 1
        if n_reads > READS_BEFORE_YIELD:
            yield_processor()
