"""Find the program ``aosplan`` and run it."""

import json
import os
import queue
import shutil
import subprocess
import sys
import threading
from pathlib import Path

#: Variables that QGIS sets for its own Python. They would break another Python interpreter.
_OF_QGIS = ("PYTHONHOME", "PYTHONPATH", "PYTHONEXECUTABLE", "VIRTUAL_ENV")


class ProgramError(Exception):
    """aosplan is not installed, ended with an error, or was cancelled."""


def find_program(given=""):
    """Return the path of the program: the given path, or the first program on PATH or in the usual
    folders.

    Raises ProgramError if there is none.
    """
    home = Path.home()
    folders = [
        os.environ.get("PATH", ""),
        str(Path(sys.prefix) / ("Scripts" if os.name == "nt" else "bin")),
        str(home / ".local" / "bin"),  # pip install --user, pipx, uv tool
        str(home / "AppData" / "Roaming" / "Python" / "Scripts"),
    ]
    found = shutil.which(given or "aosplan", path=None if given else os.pathsep.join(folders))
    if found is None:
        where = f"'{given}'" if given else "'aosplan' on the PATH"
        raise ProgramError(
            f"There is no program {where}. Install it (pipx install 'aosplan[all]') "
            "or set its path under Advanced parameters."
        )
    return found


def run_json(program, arguments, on_line=None, is_cancelled=None):
    """Run ``aosplan ARGUMENTS --json`` and return the document.

    ``on_line`` is called with each line of the standard error (warnings, hints, progress).
    ``is_cancelled`` is called several times per second.  If it returns true, the program is
    terminated.  Raises ProgramError with the program's own error text.
    """
    environment = {name: value for name, value in os.environ.items() if name not in _OF_QGIS}
    environment["PYTHONUTF8"] = "1"
    with subprocess.Popen(
        [program, *arguments, "--json"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        env=environment,
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    ) as process:
        output, said = _read(process, on_line, is_cancelled)
    if process.returncode != 0:
        errors = [line for line in said if line.startswith(("error:", "hint:"))]
        raise ProgramError("\n".join(errors or said) or "aosplan ended without a message.")
    return json.loads(output)


def _read(process, on_line, is_cancelled):
    """Return the standard output and the lines of the standard error of a process, until its end.

    Threads read both pipes. Neither pipe can therefore become full, and cancelling does not wait
    for data.
    """
    lines, output = queue.Queue(), []
    readers = [
        threading.Thread(target=lambda: output.append(process.stdout.read())),
        threading.Thread(target=lambda: [lines.put(line.rstrip()) for line in process.stderr]),
    ]
    for reader in readers:
        reader.start()
    said = []
    while any(reader.is_alive() for reader in readers) or not lines.empty():
        if is_cancelled is not None and is_cancelled():
            process.terminate()
            for reader in readers:
                reader.join()
            raise ProgramError("The plan was cancelled. No file was written.")
        try:
            line = lines.get(timeout=0.2)
        except queue.Empty:
            continue
        said.append(line)
        if on_line is not None:
            on_line(line)
    return output[0], said


def names(command):
    """Return the names that ``aosplan drones``, ``cameras`` or ``scenes`` lists.  Without a
    program, the list is empty.
    """
    try:
        return [row["name"] for row in run_json(find_program(), [command])]
    except (ProgramError, OSError, ValueError):
        return []
