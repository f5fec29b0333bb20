"""A Dask cluster of separate processes gives the same bytes, even if processes end during the
sweep.
"""

import contextlib
import json
import os
import socket
import subprocess
import sys
import threading

import pytest
from support.campaigns import contents, sweep
from support.clusters import CAMPAIGN, PARTS, ROWS, Cluster, assert_error, end

from aosplan.errors import SurroundingsError
from aosplan.sweeps import scenarios as scenarios_module
from aosplan.sweeps.parts import Parts

pl = pytest.importorskip("polars")
pytest.importorskip("distributed")

from aosplan.sweeps import cluster as cluster_module  # noqa: E402

# Schedulers and workers are processes, each of which takes a second or two to start.
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    found = Cluster(tmp_path_factory.mktemp("cluster"))
    yield found
    found.end()


@pytest.fixture
def other_cluster(tmp_path):
    (tmp_path / "cluster").mkdir()
    found = Cluster(tmp_path / "cluster")
    yield found
    found.end()


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", 40)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    path = tmp_path_factory.mktemp("campaign") / "campaign.toml"
    path.write_text(CAMPAIGN, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def local(campaign):
    """The result of a sweep in a single process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scenarios_module, "ROWS_A_BLOCK", 40)
        out = campaign.parent / "local.parquet"
        assert sweep(campaign, "--out", f"{out}/") == 0
    found = contents(out)
    assert len(found) == PARTS
    assert pl.read_parquet(out).height == ROWS
    return found


@contextlib.contextmanager
def once_parts_are_done(count, act):
    """Call a function as soon as a run has completed a given number of parts, before the run
    continues.
    """
    add, acted = Parts.add, []

    def add_and_act(parts, part):
        add(parts, part)
        if len(parts.done) == count:
            acted.append(parts)
            act()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Parts, "add", add_and_act)
        yield
    assert acted


def assert_resumed(campaign, out, local, *arguments):
    """Check that an interrupted run is incomplete, and that resuming it gives the same bytes."""
    assert not out.exists()
    journal = (out.parent / f"{out.name}.journal.jsonl").read_bytes()
    assert 2 < journal.count(b"\n") <= PARTS
    kept = {
        path: path.stat().st_mtime_ns
        for path in (out.parent / f"{out.name}.parts").glob("*.parquet")
        if f'"part": {int(path.stem[5:])},'.encode() in journal
    }
    assert sweep(campaign, "--out", f"{out}/", "--resume", *arguments) == 0
    assert contents(out) == local
    for path, time_ns in kept.items():  # Finished parts are not written again.
        assert (out / path.name).stat().st_mtime_ns == time_ns


# The same bytes


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_any_number_of_workers_gives_the_bytes_of_a_local_run(
    cluster, campaign, local, tmp_path, workers
):
    cluster.crew(workers)
    out = tmp_path / "r.parquet"
    assert sweep(campaign, "--out", f"{out}/", "--scheduler", cluster.address) == 0
    assert contents(out) == local
    journal = tmp_path / "r.parquet.journal.jsonl"
    assert sorted(os.listdir(tmp_path)) == ["r.parquet", journal.name]
    notes = [json.loads(line) for line in journal.read_text().splitlines()[1:]]
    assert [note["part"] for note in notes] == list(range(PARTS))
    assert sum(note["rows"] for note in notes) == ROWS


@pytest.mark.parametrize(
    ("name", "conditions"),
    [
        ("r.parquet", ["--columns", "samples,flight_time_s", "--where", "altitude > 60"]),
        ("r.csv", ["--best", "-flight_time_s", "--per", "altitude"]),
        ("r.jsonl", []),
    ],
)
def test_a_file_has_the_bytes_of_a_local_run(cluster, tmp_path, name, conditions):
    cluster.crew(2)
    path = tmp_path / "rows.csv"
    rows = [f"{10 + row},{'98%' if row % 7 else 0.9},{row % 5 or ''}" for row in range(150)]
    path.write_text("\n".join(["altitude,vhat,max_samples", *rows, ""]))
    (tmp_path / "here").mkdir()
    assert sweep(path, "--out", tmp_path / "here" / name, *conditions) == 0
    out = tmp_path / name
    assert sweep(path, "--out", out, *conditions, "--scheduler", cluster.address) == 0
    assert out.read_bytes() == (tmp_path / "here" / name).read_bytes()
    assert sorted(os.listdir(tmp_path)) == sorted(["here", name, "rows.csv"])


def test_the_summary_of_a_cluster_run_equals_that_of_a_local_run(cluster, tmp_path, capsys):
    cluster.crew(2)
    campaign, told = tmp_path / "s.toml", []
    campaign.write_text("[sweep]\naltitude = { start = 10, stop = 120, count = 200 }\n")
    for place, line in (("here", []), ("there", ["--scheduler", cluster.address])):
        out = tmp_path / place / "r"
        out.parent.mkdir()
        assert sweep(campaign, "--out", f"{out}/", "--summary", "--json", *line) == 0
        told.append(capsys.readouterr().out)
        assert sorted(os.listdir(out.parent)) == ["r", "r.journal.jsonl"]
    assert told[0] == told[1]
    assert json.loads(told[0])["rows"] == 200


# Failures


def test_a_killed_worker_loses_no_rows(cluster, campaign, local, tmp_path):
    cluster.crew(2)
    out = tmp_path / "r.parquet"
    with once_parts_are_done(4, lambda: end(cluster.workers.pop())):
        assert sweep(campaign, "--out", f"{out}/", "--scheduler", cluster.address) == 0
    assert contents(out) == local


def test_without_workers_for_long_it_is_an_error(
    cluster, campaign, local, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(cluster_module, "NO_WORKERS_S", 1.0)
    cluster.crew(1)
    out = tmp_path / "r.parquet"
    with once_parts_are_done(4, lambda: end(cluster.workers.pop())):
        assert sweep(campaign, "--out", f"{out}/", "--scheduler", cluster.address) == 1
    assert_error(capsys, "no worker for 1 s", "--resume")
    cluster.crew(1)
    assert_resumed(campaign, out, local, "--scheduler", cluster.address)


@pytest.mark.parametrize("another", [True, False])
def test_a_result_that_dies_with_its_worker_is_computed_again(
    cluster, campaign, local, tmp_path, monkeypatch, capsys, another
):
    cluster.crew(1)
    fetched = []

    def fetch(future, index, fetch=cluster_module.result_of):
        fetched.append(index)
        if len(fetched) == 5:  # This task is finished, but its result is still with the worker.
            end(cluster.workers.pop())
            if another:
                cluster.add_worker()
        return fetch(future, index)

    monkeypatch.setattr(cluster_module, "result_of", fetch)
    if not another:
        monkeypatch.setattr(cluster_module, "NO_WORKERS_S", 1.0)
    out = tmp_path / "r.parquet"
    status = sweep(campaign, "--out", f"{out}/", "--scheduler", cluster.address)
    assert len(fetched) > 4
    if another:
        assert status == 0
        assert contents(out) == local
    else:
        assert status == 1
        assert_error(capsys, "no worker for 1 s", "--resume")


def test_a_scheduler_that_is_killed_is_an_error(other_cluster, campaign, local, tmp_path, capsys):
    other_cluster.add_worker()
    out = tmp_path / "r.parquet"
    with once_parts_are_done(4, lambda: end(other_cluster.scheduler)):
        assert sweep(campaign, "--out", f"{out}/", "--scheduler", other_cluster.address) == 1
    assert_error(capsys, "connection to the scheduler is lost", "--resume")
    assert_resumed(campaign, out, local)


class Line:
    """A connection to a server that can be interrupted."""

    def __init__(self, address):
        self.server = socket.create_server(("127.0.0.1", 0))
        self.address = f"tcp://127.0.0.1:{self.server.getsockname()[1]}"
        self.target = ("127.0.0.1", int(address.rpartition(":")[2]))
        self.ends = [self.server]
        self._run(self._accept)

    def _run(self, *function):
        threading.Thread(target=function[0], args=function[1:], daemon=True).start()

    def _accept(self):
        with contextlib.suppress(OSError):
            while True:
                near = self.server.accept()[0]
                far = socket.create_connection(self.target)
                self.ends += [near, far]
                self._run(self._pass, near, far)
                self._run(self._pass, far, near)

    def _pass(self, source, target):
        with contextlib.suppress(OSError):
            while content := source.recv(1 << 16):
                target.sendall(content)
            target.shutdown(socket.SHUT_WR)

    def cut(self):
        for one in self.ends:
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()


def test_a_line_that_is_cut_is_an_error(cluster, campaign, local, tmp_path, capsys):
    cluster.crew(2)
    out = tmp_path / "r.parquet"
    line = Line(cluster.address)
    with once_parts_are_done(4, line.cut):
        assert sweep(campaign, "--out", f"{out}/", "--scheduler", line.address) == 1
    assert_error(capsys, "connection to the scheduler is lost", "--resume")
    assert_resumed(campaign, out, local, "--scheduler", cluster.address)


@pytest.fixture
def small_disk(tmp_path):
    """A disk with space for only some of the parts."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=100k", "none", str(place)]
    done = (
        subprocess.run(mount, capture_output=True, check=False)
        if os.path.exists("/bin/mount")
        else None
    )
    if done is None or done.returncode:
        pytest.skip("a disk cannot be mounted here")
    yield place
    subprocess.run(["umount", "-l", str(place)], check=True)


def test_a_disk_that_fills_is_an_error(cluster, campaign, local, small_disk, capsys):
    cluster.crew(2)
    out = small_disk / "r.parquet"
    assert sweep(campaign, "--out", f"{out}/", "--scheduler", cluster.address) == 1
    assert_error(capsys, "worker tcp://", "cannot write", "no space left on device", "--resume")
    subprocess.run(["mount", "-o", "remount,size=10m", str(small_disk)], check=True)
    assert_resumed(campaign, out, local, "--scheduler", cluster.address)


def test_a_partition_that_was_truncated_is_written_anew(cluster, campaign, local, tmp_path):
    cluster.crew(2)
    out = tmp_path / "r.parquet"
    assert sweep(campaign, "--out", f"{out}/") == 0
    times = {path.name: path.stat().st_mtime_ns for path in out.iterdir()}
    os.truncate(out / "part-00007.parquet", 500)
    assert sweep(campaign, "--out", f"{out}/", "--resume", "--scheduler", cluster.address) == 0
    assert contents(out) == local
    again = [path.name for path in out.iterdir() if path.stat().st_mtime_ns != times[path.name]]
    assert again == ["part-00007.parquet"]


def test_ctrl_c_keeps_completed_parts(cluster, campaign, local, tmp_path):
    cluster.crew(2)
    out = tmp_path / "r.parquet"
    code = (
        "import signal\nfrom aosplan.sweeps import scenarios\nfrom aosplan.sweeps.parts import Parts\n"
        "from aosplan.__main__ import main\n"
        "add, scenarios.ROWS_A_BLOCK = Parts.add, 40\n"
        "def add_and_interrupt(parts, part):\n"
        "    add(parts, part)\n"
        "    if len(parts.done) == 4:\n"
        "        signal.raise_signal(signal.SIGINT)\n"
        "Parts.add = add_and_interrupt\n"
        "main()\n"
    )
    line = ["sweep", campaign, "--out", f"{out}/", "--scheduler", cluster.address]
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, line)],
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 130
    assert done.stderr == "hint: finished parts are kept; --resume continues the sweep\n"
    assert_resumed(campaign, out, local, "--scheduler", cluster.address)


# Clusters that cannot be used


@pytest.fixture
def silent():
    """The address of a server that does not answer."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"127.0.0.1:{server.getsockname()[1]}"


@pytest.fixture
def nobody():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    return f"127.0.0.1:{port}"


@pytest.mark.parametrize("what", ["silent", "nobody"])
def test_an_address_without_a_scheduler_is_an_error(
    campaign, tmp_path, monkeypatch, capsys, request, what
):
    monkeypatch.setattr(cluster_module, "CONNECT_S", 1.0)
    address = request.getfixturevalue(what)
    assert sweep(campaign, "--out", tmp_path / "r.csv", "--scheduler", address) == 1
    assert_error(capsys, f"no scheduler answers at '{address}'", "dask scheduler")
    assert os.listdir(tmp_path) == []  # No part was finished, so no file remains.


def test_the_address_of_a_worker_is_refused_as_scheduler(cluster, campaign, tmp_path, capsys):
    from distributed import Client

    cluster.crew(1)
    with Client(cluster.address, set_as_default=False) as client:
        (worker,) = client.nthreads()
    assert sweep(campaign, "--out", tmp_path / "r.csv", "--scheduler", worker) == 2
    assert_error(capsys, worker, "not a scheduler")


@pytest.mark.parametrize("address", ["", "head", "head:", "http://head:80", "tcp://a b:1", "8786"])
def test_invalid_scheduler_addresses_are_refused(campaign, tmp_path, capsys, address):
    assert sweep(campaign, "--out", tmp_path / "r.csv", "--scheduler", address) == 2
    assert_error(capsys, f"--scheduler '{address}'", "tcp://")
    assert os.listdir(tmp_path) == []


def test_workers_and_a_scheduler_do_not_go_together(campaign, tmp_path, capsys):
    line = ["--scheduler", "head:8786", "--workers", 2]
    assert sweep(campaign, "--out", tmp_path / "r.csv", *line) == 2
    assert_error(capsys, "--scheduler", "--workers")


def test_a_worker_of_another_version_is_an_error(cluster, campaign, tmp_path, capsys):
    cluster.crew(0)
    package = tmp_path / "packages" / "aosplan-0.0.1.dist-info"
    package.mkdir(parents=True)
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: aosplan\nVersion: 0.0.1\n")
    cluster.add_worker(environment={"PYTHONPATH": str(package.parent)})
    cluster.await_threads(1)
    out = tmp_path / "r.parquet"
    assert sweep(campaign, "--out", f"{out}/", "--scheduler", cluster.address) == 1
    assert_error(capsys, "worker tcp://", "has aosplan 0.0.1, this machine", "pip install")
    cluster.crew(0)
    assert os.listdir(tmp_path) == ["packages"]


def test_a_cluster_without_the_program_is_an_error():
    class Bare:
        """A replacement for the client of a cluster."""

        def get_versions(self, packages):
            here = cluster_module.own_versions()
            assert {"python", *packages} == set(here)
            answer = {"host": {"python": f"{here['python']}.final.0"}, "packages": here}
            bare = answer | {"packages": here | {"aosplan": None}}
            return {"scheduler": answer, "workers": {"tcp://a:1": answer, "tcp://b:1": bare}}

    with pytest.raises(SurroundingsError, match=r"worker tcp://b:1 has no aosplan, this machine"):
        cluster_module.check_versions(Bare())


def test_a_worker_that_does_not_see_the_folder_is_an_error(cluster, campaign, tmp_path, capsys):
    (tmp_path / "shared").mkdir()
    cluster.crew(0)
    hidden = f'mount -t tmpfs none {tmp_path}/shared && exec "$@"'
    before = ["unshare", "--mount", "sh", "-c", hidden, "sh"]
    if subprocess.run([*before, "true"], capture_output=True, check=False).returncode:
        pytest.skip("folders cannot be hidden here")
    cluster.add_worker(before=before)
    cluster.await_threads(1)
    out = tmp_path / "shared" / "r.parquet"
    assert sweep(campaign, "--out", f"{out}/", "--scheduler", cluster.address) == 1
    assert_error(capsys, "worker tcp://", "does not see the folder", "--out")
    cluster.crew(0)
    assert os.listdir(tmp_path / "shared") == []


def test_a_missing_library_is_an_error(campaign, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert sweep(campaign, "--out", tmp_path / "r.csv", "--scheduler", "head:8786") == 2
    assert_error(capsys, "optional extra 'cluster'", "aosplan[cluster]")


def test_without_a_scheduler_its_library_is_not_loaded(tmp_path):
    campaign = tmp_path / "s.toml"
    campaign.write_text("[sweep]\naltitude = [40, 50]\n")
    code = (
        "import sys\nfrom aosplan.cli.app import run\n"
        f"assert run(['sweep', {str(campaign)!r}, '--out', {str(tmp_path / 'r/')!r} + '/']) == 0\n"
        "assert not {'dask', 'distributed', 'tornado'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
