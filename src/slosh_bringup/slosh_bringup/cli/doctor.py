"""`slosh doctor`: checks the installation and suggests how to fix problems."""

from __future__ import annotations

import argparse
import dataclasses
import json

from slosh_bringup.doctor import DoctorFinding, examine


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh doctor` to the argument parser."""
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Prints the result of each check; returns 1 if a required component is missing."""
    findings = []
    for finding in examine():
        findings.append(finding)
        if not arguments.json:
            print(line(finding), flush=True)
    if arguments.json:
        print(json.dumps([dataclasses.asdict(finding) for finding in findings], indent=2))
    return 0 if all(finding.ok or not finding.required for finding in findings) else 1


def line(finding: DoctorFinding) -> str:
    """Formats the result of one check as a line of text."""
    mark = "ok  " if finding.ok else ("FAIL" if finding.required else "note")
    remedy = f"; {finding.remedy}" if not finding.ok and finding.remedy else ""
    return f"{mark}  {finding.name:<18} {finding.found}{remedy}"
