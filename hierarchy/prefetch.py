"""Ask for memory before it is needed, from inside a kernel: what is waited for otherwise while nothing else is done."""

from __future__ import annotations

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic


@intrinsic
def prefetch(typing_context, array, index):  # type: ignore[no-untyped-def]
    """Bring the cache line in which an element of a one-dimensional array begins; any index may be given."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        of_array, _ = signature.args
        made = context.make_array(of_array)(context, builder, arguments[0])
        at = cgutils.get_item_pointer(context, builder, of_array, made, [arguments[1]], wraparound=False)
        byte = builder.bitcast(at, ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte.type, number, number, number])
        call = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
        # For reading, into all levels, of data.
        builder.call(call, [byte, number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, types.intp), generate
