"""`python -m slosh_bringup.cli` is `slosh`."""

import sys

from slosh_bringup.cli.main import command

sys.exit(command())
