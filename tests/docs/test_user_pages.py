"""The pages for one's own problem: their code run as a reader would, their words compared."""

import contextlib
import errno
import os
import re
import sys
import warnings
from pathlib import Path

import gymnasium
import jax
import numpy as np
import pyarrow.parquet as pq
import pytest
from gymnasium.envs.classic_control.pendulum import PendulumEnv

from detpg import ALGORITHMS, ENVIRONMENTS, replaying
from detpg.cli import main
from detpg.runs import checkpoints, lock
from detpg.types import switches
from detpg.workbench import diagnosis, judged
from detpg.workbench.tables import EVALUATIONS_SCHEMA, METRICS_SCHEMA

DOCS = Path(__file__).parents[2] / "docs"
SMALL = "--time-limit 20 --log-every 20 --evaluate-every 40 --checkpoint-every 40"
SMALL += " --evaluation-episodes 2"
OWN = """
import numpy as np
from detpg.policies import FunctionPolicy


def gain(theta, s):
    return theta @ s


policy = FunctionPolicy(gain, np.zeros((1, 2)))
"""


def blocks(page: str, language: str) -> list[str]:
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def table(page: str, heading: str) -> list[list[str]]:
    """The rows of the first table after a heading."""
    text = (DOCS / page).read_text(encoding="utf-8").split(heading, 1)[1]
    found = re.search(r"(?:^\|.*\n)+", text, flags=re.MULTILINE)
    assert found is not None
    rows = found.group().splitlines()
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in rows[2:]]


@pytest.fixture(autouse=True)
def as_a_reader(unchecked, tmp_path, monkeypatch):
    """In a folder of its own, with lines as long as they like, and the registry as it was."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "1000")
    monkeypatch.setattr(sys, "path", [*sys.path])
    known = dict(ALGORITHMS)
    with jax.numpy_rank_promotion("allow"):  # JAX's own default
        yield
    ALGORITHMS.clear()
    ALGORITHMS.update(known)


def detpg(words: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The lines that a command prints."""
    with contextlib.suppress(SystemExit):
        main(words.split())
    said = capsys.readouterr()
    return [*said.out.splitlines(), *said.err.splitlines()]


def test_five_minutes_in_python():
    names: dict = {}
    (code,) = blocks("getting_started.md", "python")
    exec(compile(code, "getting_started.md", "exec"), names)
    (before, spread_before), (after, spread_after) = names["before"], names["after"]
    error = np.hypot(spread_before, spread_after) / np.sqrt(20)
    assert after - before > 4 * error
    action, _ = names["same"].predict([1.0, 0.0, 0.0])
    np.testing.assert_array_equal(action, names["action"])


def test_the_skeletons_learn():
    names: dict = {}
    gains = []
    for block in blocks("extending.md", "python"):
        exec(compile(block, "extending.md", "exec"), names)
        if "show(learner)" in block:
            gains.append(np.asarray(names["after"] - names["before"]))
    assert len(gains) == 2
    for gain in gains:
        assert gain.mean() > 4 * gain.std(ddof=1) / np.sqrt(len(gain))
    assert names["trainer"].config.algorithm == "cacla"


def test_a_run_is_as_its_page_says(capsys):
    detpg(f"train opdac pendulum --steps 40 --seeds 2 {SMALL} --output runs/opdac-pendulum", capsys)
    names: dict = {}
    (code,) = blocks("runs.md", "python")
    exec(compile(code, "runs.md", "exec"), names)
    assert names["action"].shape == (1,)
    assert names["played"].num_rows == 2 * 20
    assert names["curve"].shape == (2, 3)
    run = Path("runs/opdac-pendulum")
    shown = {
        name for row in table("runs.md", "## Files") for name in re.findall(r"`(.*?)`", row[0])
    }
    shown = {name.split("/")[0] for name in shown}
    assert shown == {path.name for path in run.iterdir() if path.name[0] != "."}
    for heading, schema, file in (
        ("## Metrics", METRICS_SCHEMA, "metrics.parquet"),
        ("## Evaluations", EVALUATIONS_SCHEMA, "evaluations.parquet"),
    ):
        columns = [row[0].strip("`") for row in table("runs.md", heading)]
        keys = [] if file.startswith("evaluations") else ["seed", "step"]
        assert keys + columns == schema.names == pq.read_schema(run / file).names


def test_the_algorithms_are_as_the_table_says():
    rows = {re.findall(r"`(.*?)`", row[0])[0]: row for row in table("choosing.md", "## The alg")}
    assert {name for name in rows if "..." not in name} == {
        name for name in ALGORITHMS if not name.startswith("bandit-")
    }
    spec = ENVIRONMENTS["lqr"]().spec
    for name, row in rows.items():
        if "..." in name:
            continue
        learner = ALGORITHMS[name].create(spec)
        assert ("natural" in switches(ALGORITHMS[name])) == (row[6:] == ["`--natural`"]), name
        assert refused(learner) == (row[5] == "refused"), name


def refused(learner) -> bool:
    """Whether logged data are; of some learners there is a warning."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            replaying.check_learner(learner)
    except ValueError:
        return True
    return False


def plain(line: str) -> str:
    """A message without its numbers, and without what depends on them."""
    line = re.sub(r"the (observation|action|reward|TD error) of step", "a number of step", line)
    line = re.sub(r"/\S+/checkpoints", "FOLDER", line)
    return re.sub(r"\d[\d,.]*\d|\d", "#", re.sub(r"\de[-+]\d+", "1", line))


def row(**values: float) -> dict[str, float]:
    calm = {"train/saturated": 0.0, "train/exploration": 0.3, "train/policy_change": 0.1}
    return {**calm, "eval/value_bias": 0.0, "eval/value_scale": 1.0, **values}


def warned() -> list[str]:
    """All warnings about a learner, each from rows that deserve it."""
    signs = (
        {"train/saturated": 0.98},
        {"train/exploration": 1e-4},
        {"train/policy_change": 0.0},
        {"eval/value_bias": 9.1},
    )
    found = [diagnosis.warnings([row(**sign)] * 3) for sign in signs]
    return [f"seed 0: {words}" for kinds in found for words in kinds.values()]


class RigEnv(gymnasium.Env):
    """A world that need not be stepped."""

    observation_space = action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))


RIG = RigEnv()


class FailingEnv(PendulumEnv):
    """Raises in training, or returns what is not finite; every second one judges."""

    made = 0

    def __init__(self, reward=None):
        super().__init__()
        self.calls, self.reward = -1000 * (FailingEnv.made % 2), reward
        FailingEnv.made += 1

    def step(self, action):
        self.calls += 1
        seen, reward, *ends = super().step(action)
        if self.calls == 33 and self.reward is None:
            raise OSError("no link")
        return seen, self.reward if self.calls == 33 else reward, *ends


gymnasium.register("OneRig-v0", lambda: RIG)
gymnasium.register("Failing-v0", FailingEnv, max_episode_steps=20)
gymnasium.register("Broken-v0", FailingEnv, max_episode_steps=20, kwargs={"reward": float("nan")})
gymnasium.register("Endless-v0", PendulumEnv)
gymnasium.register(
    "Normalised-v0",
    lambda: gymnasium.wrappers.NormalizeObservation(gymnasium.make("Pendulum-v1")),
)


def led_into_faults(capsys, monkeypatch) -> list[str]:
    """What the commands print when they are led into the faults of the page."""
    train, wild = f"train opdac lqr {SMALL}", "--normalise none --steps 400"
    often = SMALL.replace("-every 20", "-every 5").replace("40", "5")  # some are lost before others
    Path("mine.py").write_text(OWN)
    Path("settings.toml").write_text('policy = "mine.py:policy"')
    Path("somewhere").mkdir()
    Path("somewhere/else").touch()
    named, write = "runs/stochastic-ac-Pendulum-v1", checkpoints._write

    def full(folder: Path, content: object) -> None:
        if folder.name.endswith("80"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(folder, content)

    monkeypatch.setattr(checkpoints, "_write", full)
    monkeypatch.setattr(judged, "LONGEST", 50)
    calls = [
        f"{train} --steps 80 --output {named}",
        f"{train} --steps 80 --alpha-w 0.5 --output {named}",
        f"{train} --output somewhere",
        f"{train} --steps 40 --policy mine.py:policy --output runs/mine",
        "resume runs/mine",
        f"{train} --config settings.toml",
        f"train opdac lqr {often} {wild} --alpha-w 1 --alpha-theta 1 --seeds 4 --output wild",
        f"train opdac Pendulum-v1 {SMALL} {wild} --alpha-w 1e5 --output wilder",
        f"train opdac Pendulum-v1 {SMALL} --steps 20 --output calm",
        "train dac Pendulum-v1 --config tuned",
        "train stochastic-ac Pendulum-v1 --policy mlp",
        "train opdac lqr --evaluate-every 1500",
        "train opdac pendulum --num-envs 4",
        "train opdac CartPole-v1",
        "train opdac OneRig-v0",
        "train opdac Normalised-v0",
        f"train opdac Failing-v0 {SMALL} --steps 40 --output runs/failing",
        f"train opdac Broken-v0 {SMALL.replace('40', '20')} --steps 40 --output runs/broken",
        f"train opdac Endless-v0 {SMALL.replace('--time-limit 20', '')} --steps 40",
    ]
    found = [line for call in calls for line in detpg(call, capsys)]
    Path("runs/mine/checkpoints/000000000040/manifest.ocdbt").write_bytes(b"")
    found += detpg("resume runs/mine --own-policy mine.py:policy", capsys)
    with lock.locked(Path("runs/mine")):
        busy = detpg("resume runs/mine --own-policy mine.py:policy", capsys)
    return found + [line.replace("runs/mine", "runs/opdac-pendulum") for line in busy]


def test_every_message_of_the_page_is_really_printed(capsys, monkeypatch):
    printed = set(map(plain, warned() + led_into_faults(capsys, monkeypatch)))
    quoted = [line for block in blocks("troubleshooting.md", "text") for line in block.splitlines()]
    assert len(quoted) > 12
    assert [line for line in quoted if plain(line) not in printed] == []
