"""``aosplan`` and ``python -m aosplan``: what has to be in place before anything else is loaded."""

from __future__ import annotations

import os
import signal
import sys


def main() -> None:
    """Run the command line and exit."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            # The shell has closed it; the next file to be opened would take its place.
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    # Whoever has Ctrl-C ignored, such as a job in the background, keeps it ignored.
    heeded = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if heeded:
        signal.signal(signal.SIGINT, _leave)
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, _end)
    if sys.argv[1:2] != ["thin"]:
        # The BLAS below numpy starts a thread for each processor, which takes longer than all that
        # the other commands multiply.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from aosplan.cli.app import leave, run

    try:
        if heeded:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        status = run()
    except KeyboardInterrupt:
        status = 130
    finally:
        if heeded:
            signal.signal(signal.SIGINT, _leave)
    leave(status)


def _leave(_number: int, _frame: object) -> None:
    """End at once: nothing has been begun that could be left half done, or all is done."""
    os._exit(130)


def _end(_number: int, _frame: object) -> None:
    """End as after an error, so that no temporary file is left."""
    sys.exit(143)


if __name__ == "__main__":
    main()
