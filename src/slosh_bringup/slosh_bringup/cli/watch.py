"""`slosh watch`: serves the operator's page for a running cell or a recording."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.node_process import run_until_stopped
from slosh_bringup.live.cell_setup import NAMESPACE
from slosh_bringup.processes import NodeProcess
from slosh_bringup.watch import HOST, PORT


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh watch` to the argument parser."""
    parser.add_argument(
        "bag", nargs="?", type=Path, help="recording to show (default: a running cell)"
    )
    parser.add_argument(
        "--port",
        type=int,
        default=PORT,
        help="TCP port of the web page; 0 chooses a free one (default %(default)s)",
    )
    parser.add_argument(
        "--host", default=HOST,
        help="address on which the page is served (default %(default)s: this machine only); "
        "with 0.0.0.0, on all addresses, the page's URL contains a token",
    )  # fmt: skip
    parser.add_argument(
        "--namespace", default=NAMESPACE, help="namespace of the cell (default %(default)s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Serves the operator's page until Ctrl-C is pressed."""
    if arguments.bag is None:
        return _watch_cell(arguments)
    return _watch_recording(arguments)


def _watch_cell(arguments: argparse.Namespace) -> int:
    """Starts the watch node as a process and waits until it ends."""
    given = {"host": arguments.host, "port": str(arguments.port)}
    return run_until_stopped(NodeProcess("watch", parameters=given), arguments.namespace)


def _watch_recording(arguments: argparse.Namespace) -> int:
    from slosh_bringup.watch.access import new_access
    from slosh_bringup.watch.recording import RecordedFrames
    from slosh_bringup.watch.server import WatchServer, listen, recording_app

    listener = listen(arguments.host, arguments.port)
    recording = RecordedFrames(arguments.bag, _say)
    access = new_access(arguments.host, listener.getsockname()[1])
    server = WatchServer(listener, lambda: recording_app(recording, access))
    server.start()
    _say(f"{arguments.bag} on {access.url} (Ctrl-C to stop)")
    try:
        server.wait()
    except KeyboardInterrupt:
        server.stop()
    return 0


def _say(line: str) -> None:
    print(plain_line(f"slosh watch: {line}"), file=sys.stderr)
