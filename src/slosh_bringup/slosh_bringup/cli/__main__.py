"""Runs `slosh` as `python -m slosh_bringup.cli`."""

import sys

from slosh_bringup.cli.main import command

sys.exit(command())
