"""A study small enough to run, kill and resume in seconds, also as a program."""

import sys
from pathlib import Path

from detpg.experiments.claims import Claim, above_one, ratio_of_means
from detpg.experiments.reproduce import Reproduction, run_directory
from detpg.experiments.study import Arm, Condition, Preset, Results, Study
from detpg.experiments.sweep import run_shard

TIMES = tuple(range(12, 1201, 12))


def judge(results: Results) -> list[Claim]:
    costs = [results.runs(results.study.conditions[0], arm, "final")[:, -1] for arm in ("s", "d")]
    ratio = ratio_of_means(*costs, seed=0)
    verdict = above_one(ratio)
    return [Claim("r", "s costs more", None, ratio.value, ratio.interval, 3, 0, "all", verdict)]


STUDY = Study(
    name="tiny",
    title="Tiny",
    section="5.1",
    claim="None.",
    conditions=tuple(Condition("bandit", (("m", m), ("spectrum", "mixed")), TIMES) for m in (2, 3)),
    arms=(
        Arm(
            "d",
            "bandit-copdac",
            (),
            (("alpha_theta", (0.01, 0.03, 0.1, 0.3)), ("sigma", (0.01, 0.1))),
            profile="sigma",
        ),
        Arm(
            "s",
            "bandit-stochastic-ac",
            (("actor", "score-times-q"),),
            (("alpha_theta", (0.001, 1e6)), ("alpha_y", (0.0001,)), ("sigma", (0.3, 1.0))),
        ),
    ),
    metric="cost of the mean",
    measured="cost",
    lost_above=1000.0,
    num_final=10,
    rules=("final", "mean"),
    verdicts="By hand.",
    presets={"all": Preset((), 4, fresh_seeds=3, interval_seeds=5, shard=(3, 2))},
    run_shard=run_shard,
    judge=judge,
)


def reproduce(output: Path, workers: int = 1, seed: int = 0) -> Path:
    directory = run_directory(STUDY, "all", seed, output)

    def progress(phase: str, done: int, total: int, rate: float) -> None:
        print(phase, done, total, flush=True)

    with directory.opened():
        Reproduction(STUDY, "all", seed, workers, directory, progress).run()
    return directory.path


if __name__ == "__main__":
    reproduce(Path(sys.argv[1]), workers=int(sys.argv[2]))
