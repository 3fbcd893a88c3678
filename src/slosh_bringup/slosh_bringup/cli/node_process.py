"""Runs one node as a process of a command."""

from __future__ import annotations

import signal
import subprocess

from slosh_bringup.processes import NodeProcess, node_environment


def run_until_stopped(process: NodeProcess, namespace: str) -> int:
    """Starts a node and waits until it ends, Ctrl-C is pressed or SIGTERM comes.

    Args:
        process: settings of the node.
        namespace: of the node.

    Returns:
        exit code of the node; 0 after Ctrl-C or SIGTERM.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as systemd and containers stop it
    with subprocess.Popen(process.command(namespace), env=node_environment()) as node:
        try:
            return node.wait()
        except KeyboardInterrupt:  # a terminal has told the node, too
            node.send_signal(signal.SIGINT)
            node.wait()
            return 0
