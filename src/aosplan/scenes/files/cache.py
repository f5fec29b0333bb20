"""Clouds that were read before: their voxels, kept in the user's cache folder.

An entry is a voxel file (`aosplan.scenes.files.voxel_file`) under a name made of everything that
decides its content: the files, by path, size, time of their last change and samples of their bytes,
how they were read, and the version of aosplan.  A file that changes gets another name, and the old
entry is dropped with the oldest when the folder grows too large.  Only regular files of the user's
own are read as entries, no links are followed.  The cache only ever saves time: whatever goes wrong
with it, the cloud is read.

The environment variable ``AOSPLAN_CACHE`` names another folder; ``0`` turns the cache off.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
import tempfile
from typing import TYPE_CHECKING, Any

from aosplan import __version__
from aosplan.errors import AosplanError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from aosplan.scenes.files.voxel_file import Stand
    from aosplan.scenes.voxels import VoxelVolume

VARIABLE = "AOSPLAN_CACHE"

READING = 3
"""Counts up whenever the same cloud is read into other voxels."""

MOST_OCTETS = 512 * 1024 * 1024
"""Size of all entries together."""

SAMPLES, SAMPLE_OCTETS = 16, 1 << 16
"""A file is told from another of its name by so many samples of so many bytes."""

LARGEST_SHARE = 8
"""One entry alone may have the eighth part of it."""

ENTRY = re.compile(r"[0-9a-f]{40}\.npz|\.aosplan-[\w.]+")
"""Names of entries, and of those whose writing was cut short: nothing else is ever dropped."""


def stand(
    files: Sequence[str], reading: Mapping[str, Any], read: Callable[[], VoxelVolume]
) -> tuple[Stand, bool]:
    """A cloud as voxels: from the cache, or read and kept there.

    Parameters
    ----------
    files
        Of one cloud.
    reading
        The options by which it is read.
    read
        Reads it.

    Returns
    -------
    tuple
        The stand, and whether it comes from the cache.
    """
    from aosplan.scenes.files.voxel_file import Stand, stand_in, stand_npz

    path = _entry(files, reading)
    if path is not None:
        with contextlib.suppress(AosplanError, OSError):
            found = stand_in(_own_content(path), path)
            os.utime(path)  # the oldest is what was used longest ago
            return found, True
    volume = read()
    fresh = Stand.of(volume)
    # A file that changed while it was read is kept under neither name.
    if path is not None and path == _entry(files, reading):
        with contextlib.suppress(AosplanError, OSError):
            _keep(path, stand_npz(fresh))
    return fresh, False


def folder() -> str | None:
    """Folder of the cache, which need not exist; None where it is turned off."""
    given = os.environ.get(VARIABLE)
    if given == "0":
        return None
    if given:
        return given
    from platformdirs import user_cache_dir

    return os.path.join(user_cache_dir("aosplan", appauthor=False), "clouds")


def _own_content(path: str) -> bytes:
    """Content of an entry that is a regular file of the user's own; OSError if it is not."""
    # A link is not followed, and a pipe does not wait for a writer.
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with open(os.open(path, flags | getattr(os, "O_BINARY", 0)), "rb") as file:
        status = os.fstat(file.fileno())
        own = not hasattr(os, "geteuid") or status.st_uid == os.geteuid()
        if not (stat.S_ISREG(status.st_mode) and own and status.st_size <= MOST_OCTETS):
            raise OSError(f"{path} is not an entry")
        return file.read()


def _entry(files: Sequence[str], reading: Mapping[str, Any]) -> str | None:
    """Path of the entry of a cloud; None where there can be none."""
    import hashlib

    place = folder()
    if place is None:
        return None
    parts: list[Any] = [__version__, READING, sorted(reading.items())]
    try:
        for file in files:
            status = os.stat(file)
            if not stat.S_ISREG(status.st_mode):
                return None
            known = (status.st_size, status.st_mtime_ns, sampled(file, status.st_size))
            parts.append((file, os.path.realpath(file), *known))
    except (OSError, ValueError):
        return None
    name = hashlib.sha1(repr(parts).encode(), usedforsecurity=False).hexdigest()
    return os.path.join(place, f"{name}.npz")


def sampled(path: str, size: int) -> str:
    """Checksum of a file's head, its tail and samples between; of a small one, of all of it.

    Size and time alone miss a file that was copied over another with the times kept.
    """
    import hashlib

    checksum = hashlib.sha1(usedforsecurity=False)
    with open(path, "rb") as file:
        if size <= SAMPLES * SAMPLE_OCTETS:
            checksum.update(file.read())
        else:
            for index in range(SAMPLES):
                file.seek((size - SAMPLE_OCTETS) * index // (SAMPLES - 1))
                checksum.update(file.read(SAMPLE_OCTETS))
    return checksum.hexdigest()


def _keep(path: str, content: bytes) -> None:
    if len(content) > MOST_OCTETS // LARGEST_SHARE:
        return
    place = os.path.dirname(path)
    os.makedirs(place, exist_ok=True)
    handle, temporary = tempfile.mkstemp(prefix=".aosplan-", dir=place)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(temporary, path)  # a link is replaced, never written through
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise
    _drop_oldest(place)


def _drop_oldest(place: str) -> None:
    """Drop what was used longest ago until the rest is within the bound."""
    entries = sorted(_entries(place), reverse=True)
    total = 0
    for _, size, path in entries:
        total += size
        if total > MOST_OCTETS:
            with contextlib.suppress(OSError):
                os.unlink(path)


def _entries(place: str) -> Iterator[tuple[int, int, str]]:
    """Time of last use, size and path of each entry."""
    with os.scandir(place) as found:
        for file in found:
            if ENTRY.fullmatch(file.name) and file.is_file(follow_symlinks=False):
                status = file.stat(follow_symlinks=False)
                yield status.st_mtime_ns, status.st_size, file.path
