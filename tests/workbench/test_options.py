"""Options of the environment: they reach what builds it, or are refused; settings that follow."""

import itertools

import numpy as np
import pytest
from slope import Slope

from detpg.environments import LQR
from detpg.workbench import Config, Trainer
from detpg.workbench.engines import engine_of
from detpg.world_error import WorldError

SAME = {"judge_in_same_world": True}
SMALL = {"policy": "linear", "value": "quadratic", "log_every": 10, "evaluate_every": 10}


class Tank(Slope):
    def __init__(self, area, *, leak=0.0):
        super().__init__()
        self.built = area, leak


def test_options_reach_what_builds_the_world(tmp_path):
    built = []

    def make(**options):
        built.append(Tank(**options))
        return built[-1]

    options = {"environment_options": {"area": np.float32(2.5), "leak": [1]}}
    trainer = Trainer("opdac", make, **SMALL, **options)
    trainer.save(tmp_path / "tank")
    Trainer.load(tmp_path / "tank", environment=make)
    assert {(float(area), *leak) for area, leak in (tank.built for tank in built)} == {(2.5, 1)}
    assert trainer.config.environment == "make"
    with pytest.raises(WorldError, match=r"^environment 'Tank' cannot be built: .*'area'\.$"):
        Trainer("opdac", Tank, **SMALL)
    with pytest.raises(WorldError, match=r"^environment 'Tank' cannot be built: .*'depth'\.$"):
        Trainer("opdac", Tank, **SMALL, environment_options={"area": 1, "depth": 2})
    with pytest.raises(ValueError, match=r"^The environment is built already and takes no area: "):
        Trainer("opdac", Slope(), **SMALL, **SAME, environment_options={"area": 1})


def test_options_reach_a_class_of_this_library():
    config = Config("opdac", "mine", environment_options={"horizon": 7})
    assert engine_of(Config("opdac", "mine"), LQR).spec == engine_of(Config("opdac", "lqr")).spec
    with pytest.raises(ValueError, match=r"^LQR cannot be built with \{'horizon': 7\}: "):
        engine_of(config, LQR)
    with pytest.raises(ValueError, match=r"^LQR is built already and takes no horizon: give its"):
        engine_of(config, LQR())


def test_an_option_that_no_file_can_hold_is_named(tmp_path):
    trainer = Trainer("opdac", lambda f: Slope(), **SMALL, environment_options={"f": itertools})
    with pytest.raises(ValueError, match=r"^The option <module 'itertools' .* cannot be kept in a"):
        trainer.save(tmp_path / "tank")


def test_what_a_trainer_does_not_have_does_not_refuse_it():
    fields = {"checkpoint_every": 7, "steps": -1, "keep_checkpoints": "all"}
    assert Trainer("opdac", "lqr", **SMALL, **fields).config.log_every == 10
    config = Trainer("opdac", Slope, policy="linear", num_envs=3).config
    assert (config.log_every, config.evaluate_every) == (1002, 5010)
    assert Trainer("opdac", "lqr", policy="linear", log_every=300).config.evaluate_every == 5100
