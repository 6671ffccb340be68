"""Ask for memory before it is needed, from inside a kernel: what is waited for otherwise while nothing else is done."""

from __future__ import annotations

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic


@intrinsic
def prefetch(typing_context, array, row):  # type: ignore[no-untyped-def]
    """Bring the cache line in which a row of an array begins; any number may be given, and nothing else happens."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        made = context.make_array(signature.args[0])(context, builder, arguments[0])
        stride = cgutils.unpack_tuple(builder, made.strides)[0]
        first = builder.ptrtoint(made.data, stride.type)
        byte = builder.inttoptr(builder.add(first, builder.mul(arguments[1], stride)), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte.type, number, number, number])
        call = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
        # For reading, into all levels, of data.
        builder.call(call, [byte, number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, types.intp), generate
