"""All readers with mutated files: each gives one error line or a result, within limits of time and
memory.

Each example runs the command line in a separate process.  Status, output, time and memory are
checked.  The variable ``AOSPLAN_FUZZ_EXAMPLES`` sets how many mutations of each valid file are
tried, and ``AOSPLAN_FUZZ_SEED`` sets the number of the first mutation.  Failures are written to the
folder that ``AOSPLAN_FUZZ_KEEP`` names.  Earlier failures have separate tests in
``tests/cli/test_hostile_files.py``.  Every run of the tests reads a small corpus of mutated files
(``test_corpus.py``).
"""

import os
import random
import re
import resource
import shutil
import signal
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import pytest
from support.fuzz_seeds import NUMBERS, OUR_LINES, WORDS, seeds

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, and measures memory")

for needed in ("laspy", "lazrs", "rasterio", "PIL", "polars", "shapely"):
    # Only the child processes import these modules, because threads do not survive a fork.
    if find_spec(needed) is None:
        pytest.skip(f"{needed} is not installed", allow_module_level=True)

EXAMPLES = int(os.environ.get("AOSPLAN_FUZZ_EXAMPLES", "60"))
SECONDS, KILOBYTES = 20, 2_000_000


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """The valid files, and the folder with the other inputs of their commands."""
    folder = tmp_path_factory.mktemp("good")
    return folder, seeds(folder)


def mutated(content, rng):
    """The content of a file in which parts are cut, repeated, or replaced by unexpected values."""
    content = bytearray(content)
    is_text = b"\0" not in content[:1000]
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        at = rng.randrange(len(content) + 1)
        kind = rng.randrange(7 if is_text else 5)
        if kind == 0 and content:  # one bit
            content[at % len(content)] ^= 1 << rng.randrange(8)
        elif kind == 1:  # a number in a header, which is at the start or at the end
            number = rng.choice(NUMBERS)
            near = rng.choice((at, rng.randrange(400), max(len(content) - rng.randrange(400), 0)))
            content[near : near + len(number)] = number
        elif kind == 2:
            del content[at : at + rng.choice((1, 4, 50, len(content)))]
        elif kind == 3:
            part = content[at : at + rng.choice((1, 8, 100))]
            content[at:at] = part * rng.choice((1, 2, 100))
        elif kind == 4:
            other = rng.randrange(len(content) + 1)
            content[at : at + 16] = content[other : other + 16]
        else:  # a word in a text
            words = [match.span() for match in re.finditer(rb"[-+.\w]+", content)]
            if words:
                start, stop = rng.choice(words)
                content[start:stop] = rng.choice(WORDS)
    return bytes(content)


def outcome(folder, command):
    """Run a command in a separate process and describe the fault in its result; empty if there is
    none.
    """
    said = folder / "stderr"
    started = time.monotonic()
    pid = os.fork()
    if pid == 0:  # pragma: no cover (a process of its own)
        status = 99
        try:
            signal.alarm(SECONDS)
            os.chdir(folder)
            os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            sys.stdout = os.fdopen(1, "w", encoding="utf-8", closefd=False)
            sys.stderr = os.fdopen(2, "w", encoding="utf-8", closefd=False)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            import warnings

            warnings.simplefilter("ignore")  # as `aosplan.__main__` does
            from aosplan.cli.app import run

            status = run(command.split())
            sys.stderr.flush()
        finally:
            os._exit(status)
    _, code, used = os.wait4(pid, 0)
    seconds, text = time.monotonic() - started, said.read_text(encoding="utf-8", errors="replace")
    if os.WIFSIGNALED(code):
        return f"signal {os.WTERMSIG(code)} after {seconds:.1f} s: {text[:300]}"
    status, lines = os.WEXITSTATUS(code), text.splitlines()
    errors = [line for line in lines if line.startswith("error: ")]
    if "unexpected" in text or "Traceback" in text or not all(map(OUR_LINES.match, lines)):
        return text[:500]
    if status not in (0, 1, 2) or len(errors) != (status != 0):
        return f"status {status} with {len(errors)} error lines: {text[:300]}"
    if used.ru_maxrss > KILOBYTES:
        return f"{used.ru_maxrss / 1e6:.1f} GB"
    return ""


def run_on(folder, seed, content, tmp_path):
    """Run the command of a valid file with other content in this file, and describe the fault;
    empty if there is none.
    """
    place = tmp_path / "here"
    if not place.exists():
        shutil.copytree(folder, place)
    (place / seed.name).write_bytes(content)
    return outcome(place, seed.command)


@pytest.mark.fuzz
def test_valid_files_are_read(good, tmp_path):
    folder, found = good
    for index, seed in enumerate(found):
        wrong = run_on(folder, seed, seed.content, tmp_path / str(index))
        assert not wrong, (seed.command, wrong)


@pytest.mark.fuzz
@pytest.mark.parametrize("index", range(31))
def test_mutated_files_give_a_result_or_one_error_line(good, tmp_path, index):
    folder, found = good
    assert len(found) == 31
    seed = found[index]
    start = int(os.environ.get("AOSPLAN_FUZZ_SEED", "0"))
    failures = {}
    for number in range(start, start + EXAMPLES):
        content = mutated(seed.content, random.Random(f"{index} {number}"))
        if len(content) > 1_000_000:
            continue
        wrong = run_on(folder, seed, content, tmp_path)
        if wrong:
            failures[number] = wrong
            kept = os.environ.get("AOSPLAN_FUZZ_KEEP")
            if kept:
                name = f"{index}-{number}-{os.path.basename(seed.name)}"
                Path(kept, name).write_bytes(content)
    assert not failures, (seed.command, failures)
