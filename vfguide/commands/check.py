"""`vfguide check`: all that can be known before take-off."""

import json
import sys
from collections.abc import Sequence

from vfguide.mission.finding import Finding

PASSED, WARNED, WRONG = 0, 1, 2


def report_findings(findings: Sequence[Finding], *, name: str, strict: bool, as_json: bool) -> int:
    """Print findings, one line each, and return the exit status."""
    kinds = {finding.severity for finding in findings}
    status = WRONG if "error" in kinds else WARNED if strict and "warning" in kinds else PASSED
    if as_json:
        content = {"mission": name, "findings": [finding.as_json() for finding in findings]}
        sys.stdout.write(json.dumps(content, indent=2, ensure_ascii=False) + "\n")
        return status
    for finding in findings:
        sys.stdout.write(f"{finding}\n")
    if status == PASSED:
        sys.stdout.write(f"{name}: ready to fly\n")
    return status
