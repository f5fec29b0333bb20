"""The cache of clouds saves time and does not change results."""

import os
import sys
from dataclasses import replace

import numpy as np
import pytest

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.planning.loaded_scene import load_scene
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.scenes.files import cache
from aosplan.scenes.files import point_cloud as lidar

laspy = pytest.importorskip("laspy")


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Folder of the cache; it does not exist yet."""
    monkeypatch.setenv("AOSPLAN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def readings(monkeypatch):
    """A list of the clouds that are read from their files, in order."""
    read, done = lidar.read_voxels, []
    monkeypatch.setattr(
        lidar, "read_voxels", lambda files, **given: done.append(files) or read(files, **given)
    )
    return done


def write_cloud(path, seed=0, count=4000):
    rng = np.random.default_rng(seed)
    header = laspy.LasHeader(point_format=6)
    header.scales = np.full(3, 0.001)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y = rng.uniform(0.0, 12.0, (2, count))
    canopy = rng.random(count) < 0.3
    cloud.z = np.where(canopy, rng.uniform(3.0, 9.0, count), 0.0)
    cloud.classification = np.where(canopy, 5, 2).astype(np.uint8)
    cloud.write(str(path))
    return path


@pytest.fixture
def cloud(tmp_path):
    return write_cloud(tmp_path / "stand.laz")


def resolved(scene, **given):
    return load_scene(PlanRequest(altitude=40, scene=str(scene), **given))


def entries(place):
    return sorted(path.name for path in place.iterdir())


def same(one, other):
    names = set(one.volume.__dataclass_fields__) - {"occupied"}
    return (
        np.array_equal(one.volume.occupied, other.volume.occupied)
        and all(getattr(one.volume, n) == getattr(other.volume, n) for n in names)
        and one.correlogram is other.correlogram is None
        and replace(one, from_cache=False) == replace(other, from_cache=False)
    )


def test_a_cloud_is_read_once_and_is_the_same_afterwards(place, cloud, readings, monkeypatch):
    first, second = resolved(cloud), resolved(cloud)
    assert (first.from_cache, second.from_cache) == (False, True)
    assert len(readings) == 1
    monkeypatch.setenv("AOSPLAN_CACHE", "0")
    without = resolved(cloud)
    assert len(readings) == 2
    assert same(first, without)
    assert same(second, without)


def test_a_plan_is_the_same_with_and_without_the_cache(place, cloud, monkeypatch):
    wanted = PlanRequest(altitude=40, scene=str(cloud), vhat=0.5)
    documents = [plan(wanted).document() for _ in range(2)]
    monkeypatch.setenv("AOSPLAN_CACHE", "0")
    assert documents == [plan(wanted).document()] * 2


@pytest.mark.parametrize("change", [{"voxel": 0.5}, {"ground": "class"}, {"min_height": 3.5}])
def test_other_options_of_the_reader_have_their_own_cache_entry(place, cloud, readings, change):
    resolved(cloud)
    assert not resolved(cloud, **change).from_cache
    assert resolved(cloud, **change).from_cache
    assert resolved(cloud).from_cache
    assert len(readings) == 2


def test_a_file_that_changed_is_read_again(place, cloud, readings):
    resolved(cloud)
    write_cloud(cloud, seed=1)
    fresh = resolved(cloud)
    assert not fresh.from_cache
    status = os.stat(cloud)
    os.utime(cloud, ns=(status.st_atime_ns, status.st_mtime_ns + 1))
    assert not resolved(cloud).from_cache
    assert len(readings) == 3


def test_files_of_one_stand_are_one_entry(place, tmp_path, readings):
    tiles = tmp_path / "tiles"
    tiles.mkdir()
    write_cloud(tiles / "a.laz")
    write_cloud(tiles / "b.laz", seed=1)
    assert not resolved(tiles).from_cache
    assert resolved(tiles).from_cache
    write_cloud(tiles / "b.laz", seed=2)
    assert not resolved(tiles).from_cache
    (tiles / "a.laz").unlink()
    assert not resolved(tiles).from_cache


def test_a_version_of_the_reading_has_its_own_entries(place, cloud, monkeypatch):
    resolved(cloud)
    monkeypatch.setattr(cache, "READING", cache.READING + 1)
    assert not resolved(cloud).from_cache


@pytest.mark.parametrize("damage", ["cut", "empty", "other", "folder"])
def test_a_damaged_entry_is_ignored_and_written_again(place, cloud, readings, damage):
    whole = resolved(cloud)
    (name,) = entries(place)
    entry = place / name
    content = entry.read_bytes()
    if damage == "folder":
        entry.unlink()
        entry.mkdir()
    else:
        entry.write_bytes({"cut": content[:100], "empty": b"", "other": b"PK nonsense"}[damage])
    again = resolved(cloud)
    assert same(again, whole)
    assert not again.from_cache
    if damage != "folder":
        assert entry.read_bytes() == content
        assert resolved(cloud).from_cache


def test_a_file_that_changes_while_it_is_read_is_not_kept(place, cloud, monkeypatch):
    read = lidar.read_voxels

    def slow(files, **given):
        volume = read(files, **given)
        write_cloud(cloud, seed=5)
        return volume

    monkeypatch.setattr(lidar, "read_voxels", slow)
    resolved(cloud)
    assert not place.exists()


def test_only_the_oldest_cache_entries_are_deleted(place, tmp_path, monkeypatch):
    clouds = [write_cloud(tmp_path / f"{i}.laz", seed=i) for i in range(4)]
    resolved(clouds[0])
    (first,) = entries(place)
    size = (place / first).stat().st_size
    monkeypatch.setattr(cache, "MOST_OCTETS", int(3.5 * size))
    monkeypatch.setattr(cache, "LARGEST_SHARE", 1)
    (place / "holiday.npz").write_bytes(bytes(10 * size))
    (place / ".aosplan-cutshort").write_bytes(bytes(size))
    os.utime(place / ".aosplan-cutshort", ns=(1, 1))
    os.utime(place / first, ns=(2, 2))
    resolved(clouds[1])
    resolved(clouds[2])
    # This entry is used again, so it is no longer the oldest.
    assert resolved(clouds[0]).from_cache
    assert ".aosplan-cutshort" not in entries(place)
    resolved(clouds[3])
    assert len(entries(place)) == 4
    assert "holiday.npz" in entries(place)
    assert resolved(clouds[0]).from_cache
    assert not resolved(clouds[1]).from_cache


def test_an_entry_that_would_fill_the_cache_is_not_kept(place, cloud, monkeypatch):
    monkeypatch.setattr(cache, "MOST_OCTETS", 800)
    resolved(cloud)
    assert not resolved(cloud).from_cache


def test_an_unwritable_cache_is_ignored(tmp_path, cloud, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("AOSPLAN_CACHE", str(tmp_path / "file"))
    assert not resolved(cloud).from_cache
    assert not resolved(cloud).from_cache


def test_a_missing_cloud_is_an_error_with_the_cache_too(place, tmp_path):
    with pytest.raises(RequestError, match="does not exist"):
        resolved(tmp_path / "none.laz")
    assert not place.exists()


@pytest.mark.skipif(sys.platform != "linux", reason="the rule of this system")
def test_the_folder_follows_the_rules_of_the_system(tmp_path, monkeypatch):
    monkeypatch.delenv("AOSPLAN_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.folder() == str(tmp_path / "aosplan" / "clouds")


def test_the_scene_command_reports_whether_voxels_come_from_the_cache(place, cloud, capsys):
    assert run(["scene", str(cloud), "--json"]) == 0
    first = capsys.readouterr()
    assert run(["scene", str(cloud), "--json"]) == 0
    second = capsys.readouterr()
    assert second.out == first.out
    assert "cache" not in first.err
    assert "AOSPLAN_CACHE=0" in second.err
    assert run(["scene", str(cloud), "--json", "--quiet"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.skipif(sys.platform == "win32", reason="links and pipes")
@pytest.mark.parametrize("kind", ["link", "dangling link", "pipe", "somebody else's"])
def test_only_own_regular_files_are_entries(place, cloud, readings, tmp_path, monkeypatch, kind):
    whole = resolved(cloud)
    (name,) = entries(place)
    entry, elsewhere = place / name, tmp_path / "elsewhere"
    content = entry.read_bytes()
    if kind == "somebody else's":
        monkeypatch.setattr(os, "geteuid", lambda: entry.stat().st_uid + 1)
    else:
        entry.unlink()
        if kind == "pipe":
            os.mkfifo(entry)
        else:
            entry.symlink_to(elsewhere)
            if kind == "link":
                elsewhere.write_bytes(content)
    again = resolved(cloud)
    assert same(again, whole)
    assert not again.from_cache
    assert len(readings) == 2
    assert entry.is_file()
    assert not entry.is_symlink()
    assert elsewhere.exists() == (kind == "link")


def test_a_file_copied_over_another_with_its_times_is_read_again(place, tmp_path, readings):
    cloud, other = tmp_path / "stand.las", tmp_path / "other.las"
    write_cloud(cloud, seed=0)
    write_cloud(other, seed=1)
    times = os.stat(cloud)
    assert other.stat().st_size == times.st_size
    resolved(cloud)
    cloud.write_bytes(other.read_bytes())
    os.utime(cloud, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert not resolved(cloud).from_cache
    assert len(readings) == 2


@pytest.mark.parametrize("at", [0.0, 0.3, 0.7, 1.0])
def test_samples_are_spread_over_a_large_file(tmp_path, at, monkeypatch):
    monkeypatch.setattr(cache, "SAMPLE_OCTETS", 64)
    path = tmp_path / "large"
    content = bytearray(100_000)
    path.write_bytes(content)
    before = cache.sampled_checksum(str(path), len(content))
    index = round(at * (cache.SAMPLES - 1))
    content[(len(content) - 64) * index // (cache.SAMPLES - 1)] = 1
    path.write_bytes(content)
    assert cache.sampled_checksum(str(path), len(content)) != before
