"""The larger and the smaller of two floats, in a form that the compiler finds over many numbers several at a time.

Of `max` and `min` numba makes a comparison and a choice. It cannot say of the choice that numbers are never NaN, and
without that LLVM looks at one number after the other: the largest of 1000 numbers took nine times as long.
"""

from __future__ import annotations

from typing import Any

import numba as nb
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from hierarchy.borrowing import BORROWING

# What a kernel is compiled with for this. Sums and products are as they are written, so that they are the same wherever
# they are written.
NEVER_NAN = {"nnan", "nsz"}


def _of_two(name: str, one: Any, other: Any) -> Any:
    """Return what numba asks of an intrinsic: its types, and what writes its code."""
    if not isinstance(one, types.Float) or one != other:
        return None

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        number = arguments[0].type
        kind = ir.FunctionType(number, [number, number])
        called = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.f{one.bitwidth}")
        return builder.call(called, arguments)

    return one(one, other), generate


@intrinsic
def larger(typing_context, one, other):  # type: ignore[no-untyped-def]
    """Return the larger of two floats of one type."""
    return _of_two("maxnum", one, other)


@intrinsic
def smaller(typing_context, one, other):  # type: ignore[no-untyped-def]
    """Return the smaller of two floats of one type."""
    return _of_two("minnum", one, other)


@nb.njit(**BORROWING, fastmath=NEVER_NAN)
def low_and_high(values, count):  # type: ignore[no-untyped-def]
    """Return the least and the largest of the first `count` values."""
    low = high = values[0]
    for i in range(count):
        low, high = smaller(low, values[i]), larger(high, values[i])
    return low, high
