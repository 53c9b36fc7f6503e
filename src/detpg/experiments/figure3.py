"""Figure 3: the octopus arm of Section 5.3, with a policy and a value that are networks."""

from detpg.experiments.figure3_claims import VERDICTS, judge
from detpg.experiments.octopus_shards import FURTHER, keep_policy, run_octopus_shard
from detpg.experiments.study import Arm, Condition, Options, Preset, Study

TIMES = tuple(range(15_000, 300_001, 15_000))

# The paper gives none of these; learners of their own show what the other choices do.
SCALED, SMALL_HIT = ("observation_scale", "unit"), ("hit_reward", 5.0)
NARROW = ("output_width", 0.3)
CHOSEN: Options = (SCALED, SMALL_HIT, NARROW)

_CORRELATED = (
    ("alpha_theta", (2e-3, 4e-3, 8e-3)),
    ("alpha_w", (1e-3, 3e-3)),
    ("alpha_v", (1e-2,)),
    ("sigma", (0.2,)),
    ("correlation", (0.8, 0.9, 0.95)),
)
_WHITE = (
    ("alpha_theta", (2.5e-4, 5e-4, 1e-3)),
    ("alpha_w", (1e-3, 3e-3)),
    ("alpha_v", (1e-2,)),
    ("sigma", (0.1, 0.2, 0.4)),
)
_NATURAL = (
    ("alpha_theta", (3e-5, 1e-4, 3e-4, 1e-3)),
    ("alpha_w", (1e-2,)),
    ("alpha_v", (1e-2,)),
    ("sigma", (0.2,)),
    ("correlation", (0.9,)),
)
# What each choice is good for: the correlated learner with one of them undone.
_UNDONE = (
    ("alpha_theta", (1e-3, 4e-3)),
    ("alpha_w", (3e-4, 3e-3)),
    ("alpha_v", (1e-2,)),
    ("sigma", (0.2,)),
    ("correlation", (0.9,)),
)

MAIN = "COPDAC-Q, correlated noise"
ARMS = (
    Arm(
        MAIN,
        "copdac-q",
        CHOSEN,
        _CORRELATED,
        committed=(
            ("alpha_theta", 8e-3),
            ("alpha_w", 3e-3),
            ("alpha_v", 1e-2),
            ("sigma", 0.2),
            ("correlation", 0.8),
        ),
    ),
    Arm(
        "COPDAC-Q, white noise",
        "copdac-q",
        CHOSEN,
        _WHITE,
        committed=(("alpha_theta", 1e-3), ("alpha_w", 3e-3), ("alpha_v", 1e-2), ("sigma", 0.4)),
    ),
    Arm("COPDAC-Q, natural, correlated noise", "copdac-q", (("natural", True), *CHOSEN), _NATURAL),
    Arm(
        "raw observations, correlated noise",
        "copdac-q",
        (("observation_scale", "raw"), SMALL_HIT, NARROW),
        _UNDONE,
    ),
    Arm(
        "a hit earns 50, correlated noise",
        "copdac-q",
        (SCALED, ("hit_reward", 50.0), NARROW),
        _UNDONE,
    ),
    Arm(
        "wide first weights, correlated noise",
        "copdac-q",
        (SCALED, SMALL_HIT, ("output_width", 3.0)),
        _UNDONE,
    ),
)
_NOT_COMMITTED = tuple(arm.name for arm in ARMS if not arm.committed)

FIGURE3 = Study(
    name="figure3",
    title="Octopus arm: COPDAC-Q with networks",
    section="5.3",
    claim="All ten runs learn to strike the target, and become quicker with training.",
    conditions=(Condition("octopus-arm", (), TIMES),),
    arms=ARMS,
    metric="steps to the target of one episode of the mean policy; 300 where it is missed",
    measured="steps",
    lost_above=None,
    num_final=1,
    rules=("mean",),
    verdicts=VERDICTS,
    presets={
        "smoke": Preset(
            (),
            sweep_seeds=0,
            fresh_seeds=10,
            interval_seeds=0,
            shard=(1, 5),
            without=(*_NOT_COMMITTED, "COPDAC-Q, white noise"),
            committed=True,
            recordings=3,
        ),
        "quick": Preset(
            (),
            sweep_seeds=0,
            fresh_seeds=10,
            interval_seeds=0,
            shard=(1, 10),
            without=_NOT_COMMITTED,
            committed=True,
        ),
        "paper": Preset((), sweep_seeds=4, fresh_seeds=30, interval_seeds=0, shard=(9, 30)),
    },
    run_shard=run_octopus_shard,
    judge=judge,
    further=FURTHER,
    keep=keep_policy,
)
