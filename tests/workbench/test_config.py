"""What a run is, as plain data and as a file: read back, or refused in one sentence."""

import json
import re

import pytest

from detpg.workbench import Config
from detpg.workbench.config import SETTINGS, read_settings, tuned

WORLD = {"algorithm": "opdac", "environment": "lqr"}


def test_it_comes_back_from_json():
    config = Config(
        **WORLD, hidden=(8, 4), options={"sigma": (0.1, 0.2)}, environment_options={"m": 2}
    )
    again = Config.from_json(json.loads(json.dumps(config.as_json())))
    assert again.as_json() == config.as_json()
    assert again.hidden == (8, 4)
    assert again.identity == config.identity


def test_length_and_bookkeeping_do_not_make_another_run():
    one = Config(**WORLD)
    longer = Config(**WORLD, steps=7, keep_checkpoints=1, checkpoint_every=2_000)
    assert longer.identity == one.identity
    assert Config(**WORLD, seed=1).identity != one.identity


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"steps": 0}, "steps = 0 is not usable: give 1 or more."),
        ({"seeds": -1}, "seeds = -1 is not usable: give 1 or more."),
        ({"steps": 1e5}, "steps = 100000.0 is no whole number: give one, such as 1000."),
        ({"seed": True}, "seed = True is no whole number: give one, such as 1000."),
        ({"seed": 2**31}, "seed = 2147483648 is not usable: give 0 to 2147483647."),
        ({"hidden": ()}, "hidden = () is not usable: give 1 or more for each layer."),
        ({"hidden": (8, 0)}, "hidden = (8, 0) is not usable: give 1 or more for each layer."),
        ({"hidden": ("8",)}, "hidden = '8' is no whole number: give one, such as 1000."),
        (
            {"steps": 2**31},
            "steps = 2147483648 is not usable: give less than 2^31, the steps that a run can "
            "count.",
        ),
        (
            {"log_every": 2_000_000},
            "log_every = 2000000 is not usable: give at most 1000000, since the sums of a row are "
            "of single precision.",
        ),
        ({"time_limit": 0}, "time_limit = 0 is not usable: give 1 or more."),
        (
            {"evaluate_every": 1_500},
            "evaluate_every = 1500 is no multiple of log_every = 1000: give one that is.",
        ),
        (
            {"num_envs": 3},
            "log_every = 1000 is no multiple of num_envs = 3: give one that is.",
        ),
        ({"value": "tables"}, "value = 'tables' is unknown: choose one of mlp, quadratic, tiles."),
        (
            {"normalise": "reward"},
            "normalise = 'reward' is unknown: choose one of none, observations, rewards, both.",
        ),
        ({"policy": 3}, "policy = 3 is no name: give text."),
        ({"options": ["sigma"]}, "options = ['sigma'] is no table of names and values."),
        (
            {"environment": None},
            "There is nothing to learn from: name an environment, or give data.",
        ),
    ],
)
def test_what_cannot_be_is_refused(given, said):
    with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
        Config(**WORLD | given)


def test_an_unknown_setting_is_named():
    with pytest.raises(ValueError, match=r"^'step' is no setting of a run: leave it out\.$"):
        Config.from_json({**WORLD, "step": 3})


FLAT = "steps = 50\nsigma = 0.5\nhidden = 16\n[environment_options]\ng = 9.81\n"
TABLES = """
steps = 10
seeds = 3
[opdac]
steps = 50
sigma = 0.5
[copdac-q]
steps = 99
"""


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        (
            "flat.toml",
            FLAT,
            {"steps": 50, "sigma": 0.5, "hidden": 16, "environment_options": {"g": 9.81}},
        ),
        ("tables.toml", TABLES, {"steps": 50, "seeds": 3, "sigma": 0.5}),
        ("flat.json", '{"steps": 50, "opdac": {"seeds": 2}}', {"steps": 50, "seeds": 2}),
        ("empty.toml", "", {}),
    ],
)
def test_settings_come_from_a_file(tmp_path, name, text, expected):
    (tmp_path / name).write_text(text)
    assert read_settings(tmp_path / name, "opdac") == expected


def test_a_single_layer_needs_no_list():
    assert Config.from_json({**WORLD, "hidden": 16}).hidden == (16,)


@pytest.mark.parametrize("whole", [True, False])
def test_what_a_run_has_written_are_settings_too(tmp_path, whole):
    config = Config(**WORLD, steps=7, options={"sigma": 0.5}, environment_options={"m": 2})
    content = {"detpg": "0", "run": config.as_json(), "spec": {}} if whole else config.as_json()
    (tmp_path / "config.json").write_text(json.dumps(content))
    assert Config.from_json(read_settings(tmp_path / "config.json", "opdac")) == config


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("none.toml", None, r"cannot be read \(No such file or directory\)\.$"),
        ("bad.toml", "steps = ", r"cannot be read \(.*\): give TOML, or JSON in a file \.json\.$"),
        ("bad.json", "{", r"cannot be read \(.*\): give TOML, or JSON in a file \.json\.$"),
        ("list.json", "[1]", r"holds no settings: give `name = value` lines\.$"),
    ],
)
def test_a_file_that_is_none_is_refused(tmp_path, name, text, said):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=said):
        read_settings(tmp_path / name, "opdac")


def test_what_is_known_to_learn_is_usable():
    files = sorted(SETTINGS.glob("*.toml"))
    assert files
    for file in files:
        path, learners = tuned(file.stem)
        assert path == file
        for learner in learners:
            found = read_settings(file, learner)
            own = {name: found.pop(name) for name in list(found) if not hasattr(Config, name)}
            config = Config.from_json(
                {"algorithm": learner, "environment": file.stem, **found, "options": own}
            )
            assert not {"policy", "steps"} & set(config.options)
    assert tuned("Nowhere-v0") == (None, [])
    assert tuned(None) == (None, [])
