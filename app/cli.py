"""The command `surfelscope`: hands the work on and turns errors into one line and an exit status.

0: done; 1: `bench --compare` found something slower or worse; 2: something the user has to change, said in one line
on standard error; 70: a defect of the program, in one line, too; 130: interrupted.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from app.interrupt import end_on_interrupt

if TYPE_CHECKING:
    from app.options import Options


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line (without the program's name) and return the exit status."""
    end_on_interrupt()
    # All imports come after this, so that an interrupt is quiet from the first moment on.
    from app.kernels import keep_kernels_apart

    keep_kernels_apart()
    from app.errors import EXIT_DEFECT, EXIT_ERROR, GraphicsError, OutputError, UsageError, WindowError, unforeseen
    from app.options import BENCH, parse_options
    from hierarchy.model import ModelError
    from hierarchy.plain_text import plain_line
    from renderer.context import ContextError

    line = sys.argv[1:] if arguments is None else arguments
    try:
        status = 0
        if line and line[0] == BENCH:
            # The benchmarks read a command line of their own, and need more than the viewer.
            from benchmarks.command import run_bench

            status = run_bench(line[1:])
        else:
            _run(parse_options(line))
        # Output that cannot be delivered shows here, not at the interpreter's end.
        sys.stdout.flush()
    except (UsageError, ModelError, ContextError, GraphicsError, OutputError, WindowError) as error:
        print(f"surfelscope: {error}", file=sys.stderr)
        return EXIT_ERROR
    except MemoryError:
        print("surfelscope: there is not enough memory for this", file=sys.stderr)
        return EXIT_ERROR
    except BrokenPipeError:
        # Whoever read the output has gone. Spare the interpreter a second attempt at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_ERROR
    except OSError as error:
        # Such as a standard output on a full disk.
        print(f"surfelscope: {plain_line(str(error))}", file=sys.stderr)
        return EXIT_ERROR
    except Exception as error:
        if "--verbose" in line:
            import traceback

            traceback.print_exc()
        print(f"surfelscope: {unforeseen(error)} (--verbose shows where)", file=sys.stderr)
        return EXIT_DEFECT
    return status


def _run(options: Options) -> None:
    # Each command imports what it needs, so that `render` starts without the window's libraries.
    if options.command == "render":
        from app.render_command import run_render

        run_render(options)
    elif options.command == "info":
        from app.info_command import run_info

        run_info(options)
    elif options.command == "cache":
        from app.cache_command import run_cache

        run_cache(options)
    else:
        from app.window_command import run_window

        run_window(options)


if __name__ == "__main__":
    sys.exit(main())
