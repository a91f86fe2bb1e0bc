"""A scenario's certificate from a process of its own, which steps aside for the run."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib

from hil.live.priority import step_aside
from hil.log.metadata import certificate_metadata
from hil.scenario.files import build_scenario, scenario_text
from hil.scenario.schema import Scenario

_LOWEST_PRIORITY = 19


class CertificateProcess:
    """Starts at once. The result can be had once; whoever can't wait for it goes without.

    ``niceness``: what the process takes on top of ours; by default the run goes first, always.
    """

    def __init__(self, scenario: Scenario, niceness: int = _LOWEST_PRIORITY) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "hil.live.certificate_process", str(niceness)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        if self._process.stdin is not None:
            self._process.stdin.write(scenario_text(scenario).encode())
            self._process.stdin.close()
        self._done = False

    def result(self, timeout: float = 0.0) -> dict[str, dict[str, str]]:
        """Metadata record with the certificate if it is there within ``timeout`` [s], and was not before."""
        if self._done:
            return {}
        try:
            code = self._process.wait(timeout)  # the answer is short: it fits into the pipe
        except subprocess.TimeoutExpired:
            return {}
        self._done = True
        answer = self._process.stdout
        return certificate_metadata(json.loads(answer.read())) if code == 0 and answer else {}

    def close(self) -> None:
        """End the process; safe to call again."""
        self._done = True
        self._process.kill()
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()


def _certify(niceness: int) -> None:
    step_aside(niceness)
    from hil.log.report_json import as_json
    from hil.scenario.certificate import certificate_json, certificate_of

    scenario = build_scenario(tomllib.loads(sys.stdin.read()), source="scenario of the recorder")
    sys.stdout.write(as_json(certificate_json(certificate_of(scenario))))


if __name__ == "__main__":
    _certify(niceness=int(sys.argv[1]))
