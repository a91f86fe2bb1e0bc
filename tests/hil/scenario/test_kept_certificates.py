"""Certificates that are kept from process to process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import formation.compile_cache
from estimation.bounds.assumptions import Assumptions
from estimation.bounds.certificate import Certificate, certify
from hil.scenario import kept_certificates
from hil.scenario.certificate import assumptions_of, certificate_json, certificate_lines
from hil.scenario.files import load_scenario
from hil.scenario.kept_certificates import kept_certificate

PAIR = assumptions_of(load_scenario("turtlebot3"))
LEFT = assumptions_of(load_scenario("turtlebot3", ("formation.side=left", "controller.tilt=0.1")))
CERTIFY = "estimation.bounds.certificate.certify"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(formation.compile_cache, "cache_folder", lambda: tmp_path)
    return tmp_path


@pytest.mark.parametrize("given", [PAIR, LEFT], ids=["pair", "unproved"])
def test_what_is_kept_is_what_was_worked_out_to_the_last_bit(
    given: Assumptions, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = certify(given)
    monkeypatch.setattr(CERTIFY, lambda _: known)
    assert kept_certificate(given) is known
    assert len(list(folder.glob("certificate-*"))) == 1
    monkeypatch.setattr(CERTIFY, lambda _: pytest.fail("worked out again"))
    again = kept_certificate(given)
    assert again.velocity_error == known.velocity_error
    assert again.claims() == known.claims()
    assert certificate_json(again) == certificate_json(known)
    assert list(certificate_lines(again)) == list(certificate_lines(known))


def test_other_assumptions_other_code_and_what_is_no_certificate_are_worked_out(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known, worked = certify(LEFT), list[Assumptions]()

    def note(given: Assumptions) -> Certificate:
        worked.append(given)
        return known

    monkeypatch.setattr(CERTIFY, note)
    for stamp in ("one", "one", "two"):
        monkeypatch.setattr(formation.compile_cache, "stamp_of", lambda _, stamp=stamp: stamp)
        kept_certificate(PAIR)
        kept_certificate(LEFT)
    assert worked == [PAIR, LEFT] * 2
    for number, place in enumerate(folder.glob("certificate-*")):
        place.write_text(("", '{"claims": []}', "[1]", '{"claims": {"rates": 3}}')[number], encoding="utf-8")
    kept_certificate(PAIR)
    kept_certificate(LEFT)
    assert worked == [PAIR, LEFT] * 3


@pytest.mark.parametrize("place", [None, Path("/no/such/folder")])
def test_no_place_to_keep_them_is_no_error(place: Path | None, monkeypatch: pytest.MonkeyPatch) -> None:
    known = certify(LEFT)
    monkeypatch.setattr(formation.compile_cache, "cache_folder", lambda: place)
    monkeypatch.setattr(CERTIFY, lambda _: known)
    assert kept_certificate(LEFT) is known


def test_what_cannot_be_kept_leaves_nothing_behind(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    assert kept_certificate(LEFT).claims() == certify(LEFT).claims()
    assert list(folder.glob("certificate-*")) == []


def test_no_more_than_so_many_are_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_certificates, "_MOST", 2)
    for number in range(5):
        (folder / f"certificate-{number}.json").write_text("{}", encoding="utf-8")
    kept_certificate(LEFT)
    assert len(list(folder.glob("certificate-*"))) == 2


def test_another_process_finds_it(tmp_path: Path) -> None:
    words = """
import sys
from pathlib import Path
import formation.compile_cache, estimation.bounds.certificate
from hil.scenario.certificate import certificate_of
from hil.scenario.files import load_scenario
formation.compile_cache.cache_folder = lambda: Path(sys.argv[1])
if sys.argv[2] == "again":
    estimation.bounds.certificate.certify = None
print(certificate_of(load_scenario("turtlebot3", ("controller.tilt=0.1",))).as_dict())
"""
    first, again = (
        subprocess.run(
            [sys.executable, "-c", words, str(tmp_path), which], capture_output=True, text=True, check=True
        ).stdout
        for which in ("first", "again")
    )
    assert first == again != ""
