"""Bags and the store in S3-like storage: a real server on this machine, read by ranges."""

import importlib
import pickle
import socket
import sys

import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.remote_path import BLOCK, RemotePath, bag_path
from slosh_bag.reader import BagReader
from slosh_fleet.ingest_command import ingest
from slosh_fleet.motions.motions import motions_of
from slosh_fleet.motions.store import FleetStore
from slosh_testing.observed_bag import observed

IMAGES = 12


@pytest.fixture(scope="module")
def endpoint():
    pytest.importorskip("s3fs", reason="s3fs is not installed (requirements/storage.txt)")
    server = pytest.importorskip("moto.server", reason="moto is not installed")
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    yield f"http://{host}:{port}"
    running.stop()


@pytest.fixture
def bucket(endpoint, monkeypatch):
    """The URL of an empty bucket."""
    import fsspec

    monkeypatch.setenv("AWS_ENDPOINT_URL", endpoint)
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "test")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    files = fsspec.filesystem("s3", skip_instance_cache=False)
    files.mkdir("fleet")
    yield "s3://fleet"
    files.rm("fleet", recursive=True)


@pytest.fixture
def bag(tmp_path, bucket):
    """A bag with a motion, then images that nobody asks for; its URL, size and local twin."""
    import fsspec

    rng = np.random.default_rng(3)
    images = [
        ("image", CompressedImage(data=rng.bytes(2**20)), 7.0 + 0.1 * number)
        for number in range(IMAGES)
    ]
    observed(tmp_path / "bag", images)
    for file in (tmp_path / "bag").iterdir():
        fsspec.filesystem("s3").put_file(str(file), f"fleet/bag/{file.name}")
    size = sum(file.stat().st_size for file in (tmp_path / "bag").glob("*.mcap"))
    return f"{bucket}/bag", size, tmp_path / "bag"


@pytest.fixture
def fetched(monkeypatch):
    """The lengths of all ranges that are fetched [bytes]."""
    core = pytest.importorskip("s3fs.core")
    lengths, fetch = [], core.S3File._fetch_range

    def counting(self, start, end):
        data = fetch(self, start, end)
        lengths.append(len(data))
        return data

    monkeypatch.setattr(core.S3File, "_fetch_range", counting)
    return lengths


def test_a_remote_bag_is_read_by_ranges_and_gives_the_same_motions(bag, fetched):
    url, size, local = bag
    assert list(BagReader(url).topics()) == list(BagReader(local).topics())
    assert 0 < sum(fetched) < 0.2 * size
    fetched.clear()
    (found,), (wanted,) = motions_of(url), motions_of(local)
    assert found.digest == wanted.digest
    assert found.bag == url
    assert 0 < sum(fetched) < 0.4 * size


def test_bags_and_motions_may_both_be_remote(bag, bucket, fetched):
    url, *_ = bag
    store = FleetStore(f"{bucket}/motions")
    assert ingest(bag_path(url), store) == (1, 1, False)
    fetched.clear()
    assert ingest(bag_path(url), store) == (1, 0, True)
    assert sum(fetched) <= BLOCK + 100  # its first bytes tell what the file is
    (row,) = store.dataset().to_table().to_pylist()
    assert row["bag"] == url


def test_what_is_not_there_is_told_in_one_line(bucket):
    with pytest.raises(SloshBagError, match=r"^s3://fleet/absent: no such file or folder$"):
        motions_of(f"{bucket}/absent")
    with pytest.raises(SloshBagError, match="s3://fleet/none: no motions are stored here"):
        FleetStore(f"{bucket}/none").dataset()


def test_an_endpoint_that_does_not_answer_is_told_in_one_line(bucket, monkeypatch):
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))  # bound, and nobody listens
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{closed.getsockname()[1]}")
        monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
        import fsspec

        fsspec.filesystem("s3").clear_instance_cache()
        for ask in (lambda: motions_of("s3://fleet/bag"), FleetStore("s3://fleet/m").dataset):
            with pytest.raises((SloshBagError, OSError), match="Could not connect") as caught:
                ask()
            assert "\n" not in str(caught.value)
        fsspec.filesystem("s3").clear_instance_cache()


def test_where_the_library_is_missing_the_remedy_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "s3fs", None)
    known = importlib.import_module("fsspec.registry")._registry
    monkeypatch.delitem(known, "s3", raising=False)
    for ask in (lambda: FleetStore("s3://fleet/m"), lambda: motions_of("s3://fleet/bag")):
        with pytest.raises((SloshBagError, OSError), match=r"requirements/storage\.txt") as caught:
            ask()
        assert "\n" not in str(caught.value)


def test_a_url_stays_one_through_the_methods_of_a_path():
    path = RemotePath("s3://bucket/a/b.mcap")
    assert str(path) == "s3://bucket/a/b.mcap"
    assert str(path.parent / "c") == "s3://bucket/a/c"
    assert path.resolve() == path.absolute() == path
    assert pickle.loads(pickle.dumps(path)) == path
    assert bag_path("here/bag") == bag_path(bag_path("here/bag"))
