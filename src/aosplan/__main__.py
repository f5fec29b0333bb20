"""``aosplan`` and ``python -m aosplan``: what has to be in place before anything else is loaded."""

from __future__ import annotations

import _thread
import os
import signal
import sys
import time
import warnings


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
        sys.unraisablehook = _raise_again
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, _end)
    if sys.argv[1:2] != ["thin"]:
        # The BLAS below numpy starts a thread for each processor, which takes longer than all that
        # the other commands multiply.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if not sys.warnoptions:  # -W or PYTHONWARNINGS ask for them
        # Warnings of libraries are for programmers; what a user has to know has words of our own.
        sys.warnoptions.append("ignore")  # for worker processes
        warnings.simplefilter("ignore")
    from aosplan.cli.app import leave, run

    try:
        try:
            if heeded:
                signal.signal(signal.SIGINT, signal.default_int_handler)
            status = run()
        finally:
            if heeded:
                signal.signal(signal.SIGINT, _leave)
    except KeyboardInterrupt:  # before `run` has begun to look out for it, or after it has ended
        status = 130
    leave(status)


def _leave(_number: int, _frame: object) -> None:
    """End at once: nothing has been begun that could be left half done, or all is done."""
    os._exit(130)


def _raise_again(lost: sys.UnraisableHookArgs) -> None:
    """Let Ctrl-C come once more where it fell into a callback, which no exception can leave."""
    if issubclass(lost.exc_type, KeyboardInterrupt):
        _thread.start_new_thread(_interrupt_soon, (_thread.get_ident(),))
    else:
        sys.__unraisablehook__(lost)


def _interrupt_soon(thread: int) -> None:
    time.sleep(0.01)  # by then the callback has ended
    if sys.platform == "win32":
        _thread.interrupt_main()
    else:
        signal.pthread_kill(thread, signal.SIGINT)  # which ends a wait, too


def _end(_number: int, _frame: object) -> None:
    """End as after an error, so that no temporary file is left."""
    sys.exit(143)


if __name__ == "__main__":
    main()
