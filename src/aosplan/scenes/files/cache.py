"""Cache of the voxels of point clouds that were read before, in the user's cache folder.

An entry is a voxel file (`aosplan.scenes.files.voxel_file`).  The name of an entry is a checksum of
everything that determines its content: the options of the reader, the version of aosplan, and for
each file its path, size, modification time and samples of its bytes.  A file that changes therefore
gets a new entry.  If the folder becomes too large, the least recently used entries are deleted.
Only regular files that belong to the user are read as entries, and links are not followed.  If the
cache cannot be used for any reason, the cloud itself is read.

The environment variable ``AOSPLAN_CACHE`` sets another folder; ``0`` turns the cache off.
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

    from aosplan.scenes.files.voxel_file import VoxelStand
    from aosplan.scenes.voxels import VoxelVolume

VARIABLE = "AOSPLAN_CACHE"

READING = 6
"""Version of the reader. Increase it when the reader produces other voxels from the same cloud than
before.
"""

MOST_OCTETS = 512 * 1024 * 1024
"""Largest total size of all entries [bytes]."""

SAMPLES, SAMPLE_OCTETS = 16, 1 << 16
"""Number and size [bytes] of the samples of a file that are part of its checksum. They distinguish
files with the same name.
"""

LARGEST_SHARE = 8
"""The size of a single entry is at most `MOST_OCTETS` divided by this number."""

ENTRY = re.compile(r"[0-9a-f]{40}\.npz|\.aosplan-[\w.]+")
"""Names of entries and of incomplete entries; other files are never deleted."""


def cached_stand(
    files: Sequence[str], reading: Mapping[str, Any], read: Callable[[], VoxelVolume]
) -> tuple[VoxelStand, bool]:
    """The voxels of a cloud.  They come from the cache if possible; otherwise the cloud is read and
    added to the cache.

    Parameters
    ----------
    files
        The files of one cloud.
    reading
        The options with which the cloud is read.
    read
        Function that reads the cloud.

    Returns
    -------
    tuple
        The stand, and whether it comes from the cache.
    """
    from aosplan.scenes.files.voxel_file import VoxelStand, parse_stand, stand_npz

    path = _entry(files, reading)
    if path is not None:
        with contextlib.suppress(AosplanError, OSError):
            found = parse_stand(_own_content(path), path)
            os.utime(path)  # The modification time of an entry records its last use.
            return found, True
    volume = read()
    fresh = VoxelStand.of(volume)
    # If a file changed while it was read, the voxels are not stored.
    if path is not None and path == _entry(files, reading):
        with contextlib.suppress(AosplanError, OSError):
            _keep(path, stand_npz(fresh))
    return fresh, False


def folder() -> str | None:
    """Folder of the cache, which may not exist yet; None if the cache is turned off."""
    given = os.environ.get(VARIABLE)
    if given == "0":
        return None
    if given:
        return given
    from platformdirs import user_cache_dir

    return os.path.join(user_cache_dir("aosplan", appauthor=False), "clouds")


def _own_content(path: str) -> bytes:
    """Content of an entry.  Raises OSError if the entry is not a regular file that belongs to the
    user.
    """
    # With these flags, `open` neither follows a link nor waits for the writer of a pipe.
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with open(os.open(path, flags | getattr(os, "O_BINARY", 0)), "rb") as file:
        status = os.fstat(file.fileno())
        own = not hasattr(os, "geteuid") or status.st_uid == os.geteuid()
        if not (stat.S_ISREG(status.st_mode) and own and status.st_size <= MOST_OCTETS):
            raise OSError(f"{path} is not an entry")
        return file.read()


def _entry(files: Sequence[str], reading: Mapping[str, Any]) -> str | None:
    """Path of the entry of a cloud; None if the cloud cannot be cached."""
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
            known = (status.st_size, status.st_mtime_ns, sampled_checksum(file, status.st_size))
            parts.append((file, os.path.realpath(file), *known))
    except (OSError, ValueError):
        return None
    name = hashlib.sha1(repr(parts).encode(), usedforsecurity=False).hexdigest()
    return os.path.join(place, f"{name}.npz")


def sampled_checksum(path: str, size: int) -> str:
    """Checksum of the head, the tail and samples of a file. For a small file, it is the checksum of
    the whole file.

    The checksum is needed because a different file may have the same size and time.
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
        # If the path is a link, `os.replace` replaces the link and does not write to its target.
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise
    _drop_oldest(place)


def _drop_oldest(place: str) -> None:
    """Delete the least recently used entries until the total size of the remaining entries is
    within the limit.
    """
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
