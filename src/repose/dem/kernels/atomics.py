"""A barrier at which the threads that run a kernel wait for each other.

The barrier is an array of BARRIER_SIZE int64 numbers. Two of them are counters: the
number of threads that have arrived, and the number of the round. LLVM changes them by
atomic instructions.
"""

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .jit import inlined

INT32, INT64 = ir.IntType(32), ir.IntType(64)
# Indices of the two counters, a cache line (8 numbers) apart.
ARRIVED, ROUND = 0, 8
BARRIER_SIZE = 16
# Number of times that a waiting thread reads the counter before it yields the
# processor.
READS_BEFORE_YIELD = 4000


def _write_element_pointer(context, builder, signature, values):
    """Emit code for the address of an element of an array, and return the pointer.

    Parameters
    ----------
    context, builder
        Numba's target context and LLVM's builder.
    signature : numba signature
        Types of the values.
    values : sequence of LLVM values
        The array and the index. Further values are ignored.
    """
    array = context.make_array(signature.args[0])(context, builder, values[0])
    index = context.cast(builder, values[1], signature.args[1], types.int64)
    return builder.gep(array.data, [index])


def _is_int64_array(array):
    """Return whether a numba type is that of an array of int64 numbers."""
    return isinstance(array, types.Array) and array.dtype == types.int64


@intrinsic
def atomic_add(typingctx, array, index, value):
    """Add a value to an element of an int64 array; return the element's old value.

    The element is read, increased and written in one step that no other thread can
    interrupt. For other types of arrays the result is None. This tells numba that there
    is no such function.
    """
    if not _is_int64_array(array):
        return None

    def generate(context, builder, sig, values):
        value = context.cast(builder, values[2], sig.args[2], types.int64)
        return builder.atomic_rmw(
            "add",
            _write_element_pointer(context, builder, sig, values),
            value,
            "seq_cst",
        )

    return types.int64(array, index, value), generate


@intrinsic
def atomic_load(typingctx, array, index):
    """Return an element of an int64 array that another thread may change."""
    if not _is_int64_array(array):
        return None

    def generate(context, builder, sig, values):
        return builder.load_atomic(
            _write_element_pointer(context, builder, sig, values), "seq_cst", 8
        )

    return types.int64(array, index), generate


@intrinsic
def yield_processor(typingctx):
    """Let any other thread use the processor (POSIX sched_yield)."""

    def generate(context, builder, sig, values):
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(INT32, []), "sched_yield"
        )
        builder.call(function, [])
        return context.get_dummy_value()

    return types.void(), generate


@inlined
def wait_for_all(counters, n_threads):
    """Wait until all threads have called this function.

    The last thread to arrive resets the counter of arrivals and begins the next round.
    The other threads wait until they see the new round.

    Parameters
    ----------
    counters : array (BARRIER_SIZE,) of int64
        The barrier, which all threads share. It is changed.
    n_threads : int
        Number of threads.
    """
    if n_threads == 1:
        return
    # Read the round before arriving, because the last arrival begins the next round.
    this_round = atomic_load(counters, ROUND)
    n_arrived_before = atomic_add(counters, ARRIVED, 1)
    if n_arrived_before == n_threads - 1:
        # Reset the counter before the round changes. A thread that sees the new round
        # may arrive at the next barrier at once.
        atomic_add(counters, ARRIVED, -n_threads)
        atomic_add(counters, ROUND, 1)
        return
    # Wait for the next round. After many reads, let other threads use the processor.
    n_reads = 0
    while atomic_load(counters, ROUND) == this_round:
        n_reads += 1
        if n_reads > READS_BEFORE_YIELD:
            yield_processor()
