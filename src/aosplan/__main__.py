"""Entry point of ``aosplan`` and ``python -m aosplan``.

Signals, streams and warnings are set up here before any other module is loaded.
"""

from __future__ import annotations

import _thread
import gc
import os
import signal
import sys
import time
import warnings


def main() -> None:
    """Run the command line and exit with its status."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            # The shell has closed this stream. Without a replacement, the next opened file would
            # get the descriptor of the stream.
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    # With the default threshold, garbage collection during imports takes 5 % of the time of a
    # plan.
    gc.set_threshold(100_000)
    # A shell ignores Ctrl-C for its background jobs. This setting is kept.
    heeded = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if heeded:
        signal.signal(signal.SIGINT, _leave)
        sys.unraisablehook = _raise_again
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, _end)
    if sys.argv[1:2] != ["thin"]:
        # OpenBLAS, which numpy loads, starts one thread per processor. Except in `thin`, starting
        # these threads takes longer than all matrix products of a command.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if not sys.warnoptions:  # The user has not given -W or PYTHONWARNINGS.
        # Python warnings come only from libraries and are meant for programmers. The warnings of
        # aosplan itself are messages.
        sys.warnoptions.append("ignore")  # Worker processes inherit this list.
        warnings.simplefilter("ignore")
    from aosplan.cli.app import exit_quickly, run

    try:
        try:
            if heeded:
                signal.signal(signal.SIGINT, signal.default_int_handler)
            status = run()
        finally:
            if heeded:
                signal.signal(signal.SIGINT, _leave)
    except KeyboardInterrupt:  # Ctrl-C outside `run`; `run` handles Ctrl-C itself.
        status = 130
    exit_quickly(status)


def _leave(_number: int, _frame: object) -> None:
    """Exit at once on Ctrl-C. This handler is used before the work of the command begins and after
    it has ended.
    """
    os._exit(130)


def _raise_again(lost: sys.UnraisableHookArgs) -> None:
    """Send SIGINT again if a callback discarded the KeyboardInterrupt that was raised in it."""
    if issubclass(lost.exc_type, KeyboardInterrupt):
        _thread.start_new_thread(_interrupt_soon, (_thread.get_ident(),))
    else:
        sys.__unraisablehook__(lost)


def _interrupt_soon(thread: int) -> None:
    time.sleep(0.01)  # By then, the callback has returned.
    if sys.platform == "win32":
        _thread.interrupt_main()
    else:
        # The signal also interrupts a system call that waits.
        signal.pthread_kill(thread, signal.SIGINT)


def _end(_number: int, _frame: object) -> None:
    """Exit on SIGTERM through an exception, so that temporary files are removed."""
    sys.exit(143)


if __name__ == "__main__":
    main()
