"""Runs with logs and results in an object store: a server of S3 on this computer.

For a release: thousands of objects are written one by one.
"""

import importlib.util
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.workflow.many import RECORDINGS, SETTINGS, put_many, read_tables, run_local
from tests.workflow.project import FEW, linked, put_log

pytestmark = [pytest.mark.workflow, pytest.mark.release]

MODULES = ("moto.server", "boto3", "snakemake_storage_plugin_s3")
ANYONE = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test"}
TIME_LIMIT = 3600  # s; 200 recordings take a quarter of an hour on an idle computer of two cores


class Store:
    """A server of S3, with one bucket."""

    def __init__(self, folder: Path, port: int) -> None:
        import boto3

        self.folder, self.address = folder, f"http://127.0.0.1:{port}"
        self.client = boto3.client(
            "s3", endpoint_url=self.address, region_name="us-east-1",
            aws_access_key_id="test", aws_secret_access_key="test",
        )  # fmt: skip

    def put_logs(self) -> None:
        self.client.create_bucket(Bucket="lab")
        for path in (self.folder / "logs").rglob("*"):
            if path.is_file():
                self.put(path)

    def put(self, path: Path) -> None:
        key = f"night/{path.relative_to(self.folder).as_posix()}"
        self.client.upload_file(str(path), "lab", key)

    def read(self, key: str) -> bytes:
        return self.client.get_object(Bucket="lab", Key=f"night/{key}")["Body"].read()

    def dates(self, ending: str) -> dict[str, Any]:
        """When each result with this ending was written, by key."""
        pages = self.client.get_paginator("list_objects_v2").paginate(
            Bucket="lab", Prefix="night/results/"
        )
        found = (item for page in pages for item in page.get("Contents", []))
        return {one["Key"]: one["LastModified"] for one in found if one["Key"].endswith(ending)}

    def start(self, place: Path, *flags: str, **settings: str) -> subprocess.Popen[str]:
        """Start Snakemake in a folder, with a process group of its own."""
        given = {"sensors": str(self.folder / "sensors"), "simulated": "false"} | settings
        command = [
            sys.executable, "-m", "snakemake", "-c2", *flags, "--workflow-profile", "profiles/s3",
            "--default-storage-prefix", "s3://lab/night",
            "--storage-s3-endpoint-url", self.address, "--config",
            *FEW, *SETTINGS, *(f"{key}={value}" for key, value in given.items()),
        ]  # fmt: skip
        return subprocess.Popen(
            command, cwd=place, env=os.environ | ANYONE, start_new_session=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip

    def run(self, place: Path, *flags: str, **settings: str) -> tuple[int, str]:
        with self.start(place, *flags, **settings) as process:
            said, _ = process.communicate(timeout=TIME_LIMIT)
        return process.returncode, said


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
    """A store with the logs of many recordings."""
    missing = [name for name in MODULES if not _is_installed(name)]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)} (extras storage and release)")
    folder = tmp_path_factory.mktemp("store")
    put_many(folder)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    log = (folder / "server.log").open("w")
    server = subprocess.Popen(
        [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)],
        stdout=log, stderr=subprocess.STDOUT,
    )  # fmt: skip
    try:
        for _ in range(300):
            with socket.socket() as tried:
                if tried.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.2)
        found = Store(folder, port)
        found.put_logs()
        yield found
    finally:
        server.terminate()
        server.wait()
        log.close()


def _is_installed(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:
        return False


@pytest.fixture(scope="module")
def place(store: Store) -> Path:
    return linked(store.folder / "place")


def test_a_killed_run_continues_and_makes_the_tables_of_a_local_run(
    store: Store, place: Path
) -> None:
    with store.start(place) as process:
        while len(store.dates("/scores.parquet")) < RECORDINGS // 2:
            assert process.poll() is None, process.stdout and process.stdout.read()
            time.sleep(1.0)
        os.killpg(process.pid, signal.SIGKILL)
    done = store.dates("/quality.json")
    assert RECORDINGS // 2 <= len(done) < RECORDINGS + 3
    status, said = store.run(place)
    assert status == 0, said
    after = store.dates("/quality.json")
    assert len(after) == RECORDINGS + 3
    # Only the steps that ran when it was killed, one on each core, are repeated.
    assert sum(after[key] != done[key] for key in done) <= 2
    assert f"{RECORDINGS} recordings analysed, 3 rejected" in said
    expected = read_tables(run_local(store.folder))
    assert len(store.dates(".parquet")) > len(expected)
    for name, content in expected.items():
        assert store.read(f"results/tables/{name}") == content, name
    page = store.read("results/report/index.html").decode()
    assert "sensor_0/night_000" in page and 'src="assets/' not in page  # it needs no other file


def test_only_what_is_new_in_the_bucket_is_analysed(store: Store, tmp_path: Path) -> None:
    # Another computer, which has no records of the first run.
    place = linked(tmp_path / "place")
    status, said = store.run(place)
    assert status == 0 and "steps" not in said, said
    before = store.dates("/quality.json")
    changed, added = (store.folder / f"logs/sensor_1/{name}.csv" for name in ("night_000", "new"))
    put_log(changed, 1001, samples=3000)
    put_log(added, 1002, samples=3000)
    for path in (changed, added):
        store.put(path)
    status, said = store.run(place, "--until", "datasheet")
    assert status == 0, said
    after = store.dates("/quality.json")
    names = {key.split("/")[-2] for key in after if before.get(key) != after[key]}
    assert names == {"night_000", "new"}


def test_settings_that_need_a_disk_are_refused(store: Store, place: Path) -> None:
    for settings, reason in (
        ({"results": "/tmp/results"}, "results: found '/tmp/results'; expected a relative path"),
        ({"reconstruction": '{"keep_series": true}'}, "keep_series: found true; expected false"),
    ):
        status, said = store.run(place, "-n", **settings)
        assert status == 1 and reason in said, said
