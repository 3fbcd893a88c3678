"""Tests shared-memory communication and the remains of killed processes."""

import contextlib
import fcntl
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import rclpy
from std_msgs.msg import String

from slosh_msgs_py import qos
from slosh_msgs_py.node.dead_ports import DeadPorts, free_dead_ports
from slosh_msgs_py.node.shared_memory import is_deaf, remove_leftovers

SEGMENT = "fastrtps_71a8d4d185374fd8"
QUEUE = 41_440
"""Where a port's memory has the queue of messages, behind its listeners' states."""


@pytest.mark.parametrize(
    ("held", "mapped", "deaf"),
    [
        ([], [], False),  # no shared memory at all
        ([SEGMENT], [], True),
        # A port below RTPS's own serves the whole machine, not this process.
        ([SEGMENT, "fastrtps_port7002"], ["fastrtps_port7002"], True),
        ([SEGMENT, "fastrtps_port7411"], ["fastrtps_port7411"], False),
        # Held for a dead process.
        ([SEGMENT, "fastrtps_port7413"], ["fastrtps_port7413"], True),
        # Made anew by others: what it reads is another's memory.
        ([SEGMENT, "fastrtps_port7411"], ["other"], True),
        ([SEGMENT, "fastrtps_port7411"], [], True),
    ],
)
def test_a_process_without_its_shared_memory_port_is_deaf(tmp_path, held, mapped, deaf):
    memory, process = tmp_path / "shm", tmp_path / "self"
    (process / "fd").mkdir(parents=True)
    memory.mkdir()
    for number, name in enumerate(held):
        (process / "fd" / str(number)).symlink_to(memory / f"{name}_el")
    for name in ("other", *held):
        (memory / name).touch()
    lines = [
        f"7f-80 rw-s 00000000 00:1b {(memory / name).stat().st_ino}  /dev/shm/fastrtps_port7411\n"
        for name in mapped
    ]
    (process / "maps").write_text("7f-80 rw-p 00000000 00:00 0\n" + "".join(lines))
    assert is_deaf(process, ["fastrtps_port7413"]) == deaf
    assert not is_deaf(tmp_path / "nowhere")


def test_what_killed_nodes_leave_in_shared_memory_is_removed_and_nothing_else(tmp_path):
    names = [f"fastrtps_{number:016x}" for number in range(3)]
    for name in (*names, "fastrtps_port7411", "somebody_else"):
        (tmp_path / name).write_bytes(bytes(1000))
        (tmp_path / f"{name}_el").touch()
    later = time.time() + 60.0
    with (tmp_path / f"{names[1]}_el").open() as held:
        fcntl.flock(held, fcntl.LOCK_SH)
        assert remove_leftovers(tmp_path) == 0  # all are young
        assert remove_leftovers(tmp_path, later) == 2000
    left = {path.name for path in tmp_path.iterdir() if not path.name.endswith("_el")}
    assert left == {names[1], "fastrtps_port7411", "somebody_else"}


def mutex(folder, port, count):
    path = folder / f"sem.fastrtps_port{port}_mutex"
    path.write_bytes(count.to_bytes(8, sys.byteorder) + bytes(24))
    return path


def test_a_ports_mutex_that_stays_locked_is_deleted_and_no_other(tmp_path):
    dead, free, busy = (mutex(tmp_path, port, count) for port, count in ((1, 0), (2, 1), (3, 0)))
    (tmp_path / "sem.somebody_elses_mutex").write_bytes(bytes(32))
    (tmp_path / "sem.fastrtps_port4_mutex").write_bytes(b"")
    unlocking = threading.Timer(0.1, mutex, (tmp_path, 3, 1))
    unlocking.start()
    heard = mutex(tmp_path, 5, 0)
    for name in ("fastrtps_port1", "fastrtps_port2", "fastrtps_port5", "fastrtps_port5_el"):
        (tmp_path / name).touch()
    with (tmp_path / "fastrtps_port5_el").open() as listens:
        fcntl.flock(listens, fcntl.LOCK_EX)
        assert free_dead_ports(tmp_path, 0.5) == ["fastrtps_port1", "fastrtps_port5"]
    unlocking.join()
    assert not heard.exists()
    ports = {path.name for path in tmp_path.glob("fastrtps_port?")}
    assert ports == {"fastrtps_port2", "fastrtps_port5"}
    assert not dead.exists()
    assert free.exists()
    assert busy.exists()


@pytest.mark.long
def test_a_node_starts_where_a_killed_one_left_its_port_locked(domain):
    """Without the lock the process hangs in the middleware and ignores signals but SIGKILL."""
    speaks = "import rclpy; rclpy.init(); rclpy.create_node('tested'); print('speaks')"
    taken = 7400 + 250 * domain
    locked = [mutex(Path("/dev/shm"), taken + offset, 0) for offset in range(10, 32)]
    try:
        free_dead_ports()
        # Each node that starts looks after them, those of other tests on this machine, too.
        assert not any(path.exists() for path in locked)
        done = subprocess.run(
            [sys.executable, "-c", speaks], capture_output=True, text=True, timeout=60, check=True
        )
        assert done.stdout == "speaks\n"
    finally:
        for path in locked:
            path.unlink(missing_ok=True)


def folders(tmp_path, ports, mapped):
    """Creates a folder of ports with locks, and one of processes that have them mapped."""
    memory, processes = tmp_path / "memory", tmp_path / "processes"
    memory.mkdir()
    for port in ports:
        (memory / port).touch()
        os.utime(memory / port, (0.0, 0.0))
        (memory / f"{port}_el").touch()
    for number, lines in enumerate(mapped, start=1):
        (processes / str(number)).mkdir(parents=True)
        text = "".join(f"7f00-7f01 rw-s 0 00:1b 7    /dev/shm/{line}\n" for line in lines)
        (processes / str(number) / "maps").write_text(text)
    return memory, processes


def test_dead_ports_are_held_while_somebody_has_them_open(tmp_path):
    """Ports of running processes, and ports that nobody has mapped, are not locked."""
    dead, living, forgotten = "fastrtps_port7411", "fastrtps_port7413", "fastrtps_port7415"
    mapped = [[f"{dead} (deleted)", living], [living]]
    memory, processes = folders(tmp_path, (dead, living, forgotten), mapped)
    ports, others = DeadPorts(memory, processes), DeadPorts(memory, processes)
    with (memory / f"{living}_el").open() as listens:
        fcntl.flock(listens, fcntl.LOCK_EX)
        # Several hold it at once.
        assert ports.look(0.0, close=True) == others.look(0.0) == (dead,)
    closed = {path.name for path in memory.glob("*[0-9]") if path.stat().st_size}
    assert closed == {dead}
    for path in processes.glob("*/maps"):
        path.write_text("")
    others.close()
    with (memory / f"{dead}_el").open() as taker:
        assert ports.look(29.0) == (dead,)  # its writers come back to it now and then
        with pytest.raises(BlockingIOError):
            fcntl.flock(taker, fcntl.LOCK_EX | fcntl.LOCK_NB)
        assert ports.look(31.0) == ports.names == ()
        assert {path.name for path in memory.glob("*[0-9]")} == {living, forgotten}
        fcntl.flock(taker, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_a_port_that_somebody_made_anew_is_not_deleted(tmp_path):
    port = "fastrtps_port7411"
    memory, processes = folders(tmp_path, (port,), [[port]])
    ports = DeadPorts(memory, processes)
    assert ports.look(0.0, close=True) == (port,)
    (memory / port).write_bytes(b"new")
    ports.close()
    assert free_dead_ports(memory) == []
    assert (memory / port).read_bytes() == b"new"


def test_what_a_killed_holder_left_closed_is_open_to_the_next(tmp_path):
    port = "fastrtps_port7411"
    memory, processes = folders(tmp_path, (port,), [[port]])
    ports = DeadPorts(memory, processes)
    ports.look(0.0, close=True)
    free_dead_ports(memory)
    assert (memory / port).exists()  # it is held
    (memory / port).rename(memory / "aside")
    ports.close()
    (memory / "aside").rename(memory / port)
    free_dead_ports(memory)
    assert not (memory / port).exists()


READS = """
import rclpy
from rclpy.node import Node
from std_msgs.msg import String
from slosh_msgs_py import qos
from slosh_msgs_py.node.run import initialise, make_heard
initialise([])
node = make_heard(lambda: Node("reads"))
hear = lambda message: print(message.data, flush=True)
node.create_subscription(String, "words", hear, qos.EVENT)
rclpy.spin(node)
"""


@contextlib.contextmanager
def reader():
    """A process that prints the messages that it receives."""
    command = [sys.executable, "-c", READS]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def heard(process):
    """Returns the next received message, without Fast DDS's own output."""
    return next(line.strip() for line in process.stdout if "RTPS_TRANSPORT_SHM" not in line)


def rtps_ports(process):
    """Returns the port numbers whose lock file a process has open."""
    links = [os.readlink(link) for link in Path(f"/proc/{process.pid}/fd").iterdir()]
    ports = [int(found[1]) for link in links if (found := re.search(r"_port(\d+)_el", link))]
    return [port for port in ports if port >= 7400]


@pytest.fixture
def writer(domain):
    """A publisher, the held ports, and a function that finds a subscriber's port."""
    rclpy.init()
    node = rclpy.create_node("writes")
    words = node.create_publisher(String, "words", qos.EVENT)
    before, ports, own = DeadPorts(), DeadPorts(), 7400 + 250 * domain
    dead = {int(name.removeprefix("fastrtps_port")) for name in before.look()}

    def port_of(process):
        (port,) = {*range(own, own + 250)} & {*rtps_ports(process)} - dead
        return port

    try:
        words.publish(String(data="hello"))
        yield words, ports, port_of
    finally:
        ports.close()
        before.close()
        node.destroy_node()
        rclpy.shutdown()


@pytest.mark.long
def test_nobody_takes_over_the_port_of_a_killed_reader_that_is_still_written_to(writer):
    """Otherwise the publisher would still write to the killed process's port."""
    words, ports, port_of = writer
    with reader() as first:
        assert heard(first) == "hello"
        taken = port_of(first)
        first.send_signal(signal.SIGKILL)
        first.wait()
    os.utime(f"/dev/shm/fastrtps_port{taken}", (0.0, 0.0))  # no process starts there any more
    assert f"fastrtps_port{taken}" in ports.look()
    with reader() as second:
        assert heard(second) == "hello"
        words.publish(String(data="again"))
        assert heard(second) == "again"
        assert f"fastrtps_port{taken}" in ports.names
        assert set(rtps_ports(second)) - {taken}


def test_who_has_the_port_of_a_killed_reader_open_writes_to_it_no_more(writer):
    """Otherwise unread messages fill the publisher's shared memory."""
    words, ports, port_of = writer
    with reader() as first:
        assert heard(first) == "hello"
        taken = port_of(first)
        with Path(f"/dev/shm/fastrtps_port{taken}").open("rb", buffering=0) as memory:

            def written():
                memory.seek(QUEUE)
                return memory.read()

            first.send_signal(signal.SIGKILL)
            first.wait()
            queue = written()
            words.publish(String(data="to the dead"))
            assert written() != queue  # nobody has found out yet
            ports.look(close=True)
            queue = written()
            for number in range(10):
                words.publish(String(data=f"to nobody {number}"))
            assert written() == queue
    with reader() as second:
        assert heard(second) == "hello"


@pytest.mark.parametrize(
    ("name", "flags", "size"),
    [
        ("fastrtps_port7411", 255, 512),
        ("fastrtps_port7413", 7, 512),
        ("fastrtps_port7411", 7, 290),
    ],
)
def test_memory_that_looks_strange_is_left_alone(tmp_path, name, flags, size):
    """The contents could be those of another version of the middleware."""
    memory, processes = folders(tmp_path, (name,), [[name]])
    content = bytearray(512)
    content[276:280], content[300] = (7411).to_bytes(4, sys.byteorder), flags
    content = content[:size]
    (memory / name).write_bytes(content)
    os.link(memory / name, memory / "aside")
    assert DeadPorts(memory, processes).look(0.0, close=True) == (name,)
    assert (memory / "aside").read_bytes() == content


LOSES = """
import os, sys
from pathlib import Path
from rclpy.node import Node
from slosh_msgs_py.node.run import run_node

class Loses(Node):
    def __init__(self):
        super().__init__("loses")
        self.create_timer(0.1, self.lose)

    def lose(self):
        for link in Path("/proc/self/fd").iterdir():
            if link.exists() and "fastrtps_port" in (lock := os.readlink(link)):
                if sys.argv[1] == "closed":
                    os.close(int(link.name))
                elif (port := Path(lock.removesuffix("_el"))).exists():
                    port.unlink()

sys.exit(run_node(Loses, []))
"""


@pytest.mark.long
@pytest.mark.parametrize("how", ["closed", "deleted"])
def test_a_node_that_loses_its_port_says_so_and_ends(domain, how):
    """Otherwise the node would receive nothing without anyone noticing."""
    done = subprocess.run(
        [sys.executable, "-c", LOSES, how], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1, done.stderr
    assert "loses: its shared-memory port was taken over by another process" in done.stderr
    assert "Traceback" not in done.stderr
