from __future__ import annotations

from dataclasses import replace
from html import unescape

from hil.judge.run_data import LogFacts, RunData, run_data_of_log
from hil.judge.summary import summarise
from hil.log.origin import MADE, Origin, made_here
from hil.log.reader import Log
from hil.reports.provenance import provenance_html
from hil.scenario.files import load_scenario, scenario_text

OVERRIDES = ["run.seed=7", "mocap.loss=0.25", "run.duration_s=2.5", "controller.law=faded"]


def made(run_data: RunData, origin: Origin) -> str:
    log = LogFacts("my runs/run.mcap", 5, 1000)
    return unescape(provenance_html(replace(run_data, origin=origin, log=log), summarise(run_data)))


def test_the_command_that_repeats_a_run_makes_its_scenario(exact_run_data: RunData) -> None:
    scenario = load_scenario("turtlebot3", OVERRIDES)
    said = made(exact_run_data, Origin("0.2.0", "lockstep", "7", scenario_toml=scenario_text(scenario)))
    again = "abreast run turtlebot3 --seed 7 --duration 2.5 --law faded --set mocap.loss=0.25 --lockstep"
    assert again in said
    assert "abreast replay 'my runs/run.mcap' --verify" in said


def test_a_scenario_of_ones_own_is_there_to_be_copied(exact_run_data: RunData) -> None:
    own = load_scenario("turtlebot3", ["name=<mine>"])
    said = made(exact_run_data, Origin("0.2.0", "live", "1", scenario_toml=scenario_text(own)))
    assert "abreast run scenario.toml --seed 1" in said
    assert scenario_text(own) in said


def test_a_live_log_tells_where_and_when_it_was_made(exact_run_data: RunData) -> None:
    said = made(exact_run_data, Origin("0.2.0", "live", **made_here()[MADE]))
    assert {"host", "Python", "begun"} <= set(said.replace("<dt>", " ").replace("</dt>", " ").split())
    assert made_here()[MADE]["host"] in said


def test_a_lockstep_log_is_the_same_on_every_host(short_log: Log) -> None:
    assert MADE not in short_log.metadata
    assert run_data_of_log(short_log).origin.host == ""


def test_nothing_is_made_up_of_a_log_that_tells_nothing(exact_run_data: RunData) -> None:
    said = made(exact_run_data, Origin())
    assert "abreast run" not in said
    assert "--verify" not in said
