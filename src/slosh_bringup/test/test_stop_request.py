"""A second signal while the report is made ends the process, wherever it comes."""

import subprocess
import sys

IN_A_CALLBACK = """
import ctypes, os, signal
from slosh_bringup.stop_request import StopRequest

def called_from_c():
    os.kill(os.getpid(), signal.SIGTERM)
    return sum(range(1000))

with StopRequest() as stop:
    called_from_c()
    with stop.finishing(lambda: os._exit(7)):
        {again}
    called_from_c()
    print(stop.reason)
"""


def ends(again):
    script = IN_A_CALLBACK.format(again=again)
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stderr == ""
    return done.returncode, done.stdout.strip()


def test_it_is_not_lost_in_a_function_that_a_library_calls():
    """An exception is: ctypes prints it and goes on, so do weak references and destructors."""
    assert ends("ctypes.CFUNCTYPE(ctypes.c_int)(called_from_c)()") == (7, "")


def test_before_and_after_it_asks_for_the_end_and_no_more():
    assert ends("pass") == (0, "SIGTERM")
