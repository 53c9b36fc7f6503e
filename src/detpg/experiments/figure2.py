"""Figure 2: mountain car, pendulum and puddle world of Section 5.2, on tile-coded features."""

import numpy as np

from detpg.experiments.figure2_claims import VERDICTS, judge
from detpg.experiments.kernel_shards import FURTHER, run_kernel_shard
from detpg.experiments.study import Arm, Condition, Preset, Study

NUM_TIMES = 20
HORIZONS = {"mountain-car": 100_000, "pendulum": 500_000, "puddle-world": 500_000}

# In units of the legal range's half: "initialised to 1/2 the legal range".
WIDTH = (0.5,)

_CRITIC = (0.03, 0.1, 0.3, 1.0, 1.7)
_COPDAC = (
    ("alpha_theta", (1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3)),
    ("alpha_w", (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)),
    ("alpha_v", _CRITIC),
    ("sigma", WIDTH),
)
_NATURAL = (
    ("alpha_theta", (1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3)),
    ("alpha_w", (0.001, 0.003, 0.01, 0.03, 0.1, 0.3)),
    ("alpha_v", _CRITIC),
    ("sigma", WIDTH),
)
_GRADIENT = (
    ("alpha_theta", (1e-3, 3e-3, 0.01, 0.03, 0.1)),
    ("alpha_w", (0.03, 0.1, 0.3, 1.0)),
    ("alpha_v", (0.03, 0.1, 0.3, 1.0)),
    ("alpha_u", (1e-4, 1e-3, 0.01)),
    ("sigma", WIDTH),
)
_TIED = (
    ("alpha_u", tuple(float(f"{x:.3g}") for x in 10 ** np.linspace(-5, -1, 20))),
    ("alpha_v", tuple(float(f"{x:.3g}") for x in 10 ** np.linspace(-1.75, 0.25, 12))),
    ("sigma0", WIDTH),
)
_OWN_STEP = (
    ("alpha_u", (1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3)),
    ("alpha_y", (0.0, 1e-6, 1e-5, 1e-4, 1e-3)),
    ("alpha_v", (0.03, 0.1, 0.2, 0.5, 1.0, 1.5)),
    ("sigma0", WIDTH),
)
_BEHAVIOUR = (("sigma", WIDTH),)
_SAME_STEP = (("alpha_y", "alpha_u"),)

ARMS = (
    Arm("COPDAC-Q", "copdac-q", (), _COPDAC),
    Arm("SAC, as printed", "stochastic-ac", (), _TIED, ties=_SAME_STEP),
    Arm("OffPAC, as printed", "offpac", (), (*_TIED, *_BEHAVIOUR), ties=_SAME_STEP),
    Arm("SAC, controlled", "stochastic-ac", (), _OWN_STEP),
    Arm("OffPAC, controlled", "offpac", (), (*_OWN_STEP, *_BEHAVIOUR)),
    Arm("COPDAC-Q, natural", "copdac-q", (("natural", True),), _NATURAL),
    Arm("COPDAC-GQ", "copdac-gq", (), _GRADIENT),
)
_CONTROLLED = ("SAC, controlled", "OffPAC, controlled")
_EXTRA = ("COPDAC-Q, natural", "COPDAC-GQ")
_THIN = (("alpha_theta", 2), ("alpha_w", 2), ("alpha_v", 2), ("alpha_u", 2), ("alpha_y", 2))
_SPARSE = (("alpha_theta", 4), ("alpha_w", 3), ("alpha_v", 3), ("alpha_u", 4), ("alpha_y", 3))


def _times(horizon: int) -> tuple[int, ...]:
    """Twenty points from 0 to the horizon, both included."""
    return tuple(round(horizon * i / (NUM_TIMES - 1)) for i in range(NUM_TIMES))


FIGURE2 = Study(
    name="figure2",
    title="Mountain car, pendulum and puddle world: COPDAC-Q against stochastic actor-critics",
    section="5.2",
    claim="COPDAC-Q slightly outperforms SAC and OffPAC in all three tasks.",
    conditions=tuple(Condition(task, (), _times(horizon)) for task, horizon in HORIZONS.items()),
    arms=ARMS,
    metric="undiscounted return of one episode of the mean policy, cut after 5,000 steps",
    measured="return",
    lost_above=None,
    num_final=1,
    rules=("mean", "final"),
    verdicts=VERDICTS,
    presets={
        "smoke": Preset(
            _SPARSE,
            sweep_seeds=2,
            fresh_seeds=5,
            interval_seeds=0,
            shard=(4, 5),
            without=(*_EXTRA, *_CONTROLLED, "OffPAC, as printed"),
        ),
        "quick": Preset(
            _THIN, sweep_seeds=3, fresh_seeds=30, interval_seeds=0, shard=(16, 10), without=_EXTRA
        ),
        "paper": Preset((), sweep_seeds=5, fresh_seeds=30, interval_seeds=100, shard=(24, 10)),
    },
    run_shard=run_kernel_shard,
    judge=judge,
    further=FURTHER,
)
