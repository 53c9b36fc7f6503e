"""The study of Figure 1 as data, and its judgement on made-up runs whose verdicts are known."""

import json

import numpy as np

from detpg.algorithms import ALGORITHMS
from detpg.experiments import STUDIES
from detpg.experiments.figure1 import ACTORS, COPDAC, DIMENSIONS, FIGURE1, SPECTRA, adapted, fixed
from detpg.experiments.selection import Choice, Selection
from detpg.experiments.study import Results
from detpg.types import hyper_parameters

FINAL = {10: 4e-3, 25: 0.25, 50: 10.0}


def made_up(advantage_gap: float, lost: bool = False) -> Results:
    """COPDAC-B at 0.002 for every m; SAC-B as published; fixed twice the adapted one."""
    selections, costs = {}, {}
    for condition in FIGURE1.conditions:
        m = dict(condition.options)["m"]
        for arm in FIGURE1.arms:
            roles = ["final", "mean"]
            roles += [f"{r} sigma={s:g}" for r in roles for s in (0.001, 0.1) if arm.profile]
            choices = tuple(Choice(role, "final", 0, 1.0, ()) for role in roles)
            selections[condition, arm.name] = Selection(choices, 0, 1)
            level = 2e-3
            if arm.name != COPDAC:
                level = FINAL[m] if ACTORS[0] in arm.name else 2e-3 * advantage_gap
                level *= 2 if "fixed" in arm.name else 1
            spread = np.linspace(0.9, 1.1, 5)[None, :, None]
            costs[condition, arm.name, "fresh"] = level * spread * np.ones((len(roles), 5, 100))
    points = {arm.name: arm.points() for arm in FIGURE1.arms}
    if lost:
        for condition in FIGURE1.conditions[:2]:
            costs[condition, adapted(ACTORS[0]), "fresh"] *= np.nan
    return Results(FIGURE1, selections, costs, points, seed=0)


def test_every_dimension_and_reading_is_judged():
    claims = FIGURE1.judge(made_up(2.0))
    assert len({claim.id for claim in claims}) == len(claims)
    readings = len(SPECTRA) * len(ACTORS)
    assert len(claims) == readings * (2 * 2 * (2 * 3 + 1) + 4 * 3 + 1)
    for m in DIMENSIONS:
        assert sum(f"/m-{m}/" in claim.id for claim in claims) == readings * (2 * 2 * 2 + 4)


def test_verdicts_on_made_up_runs():
    verdicts = {claim.id: claim.verdict for claim in FIGURE1.judge(made_up(0.5))}
    q, advantage = f"mixed/{ACTORS[0]}", f"mixed/{ACTORS[1]}"
    assert verdicts[f"ratio-10000/m-10/{q}/final/best-sigma"] == "reproduced"  # 2 against 1.2
    assert verdicts[f"ratio-10000/m-25/{q}/final/best-sigma"] == "not reproduced"  # 125 : 16.6
    assert verdicts[f"growth/{q}/final/best-sigma"] == "reproduced"
    assert verdicts[f"growth/{advantage}/final/best-sigma"] == "inconclusive"  # the same at every m
    assert verdicts[f"fixed-both-0.1/m-50/{q}"] == "reproduced"
    assert verdicts[f"fixed-growth/{q}"] == "reproduced"
    assert verdicts[f"fixed-no-better/m-50/{q}"] == "reproduced"


def test_a_learner_that_always_diverges_is_a_claim_without_a_number():
    claims = {claim.id: claim for claim in FIGURE1.judge(made_up(0.5, lost=True))}
    q = f"mixed/{ACTORS[0]}/final/best-sigma"
    for claim in (claims[f"ratio-10000/m-10/{q}"], claims[f"growth/{q}"]):
        assert claim.as_json()["measured"] is None
        assert claim.verdict == "inconclusive"
    assert claims[f"ratio-10000/m-10/{q}"].num_diverged == 5


def test_fixing_the_variance_closes_the_gap_when_it_does():
    verdicts = {claim.id: claim.verdict for claim in FIGURE1.judge(made_up(0.25))}
    assert verdicts[f"fixed-both-best/m-25/isotropic/{ACTORS[1]}"] == "not reproduced"


def test_grids_name_hyper_parameters_of_their_algorithm():
    for arm in FIGURE1.arms:
        known = hyper_parameters(ALGORITHMS[arm.algorithm])
        assert {name for name, _ in arm.grid} <= set(known)
        for name, values in arm.grid:
            assert list(values) == sorted(set(values))
            assert all(known[name].low <= v <= known[name].high for v in values)


def test_the_control_has_every_width_of_copdac():
    """Fixing SAC-B's variance at COPDAC-B's width needs that width in both grids."""
    arms = {arm.name: dict(arm.grid) for arm in FIGURE1.arms}
    for actor in ACTORS:
        assert set(arms[COPDAC]["sigma"]) <= set(arms[fixed(actor)]["sigma"])
        assert "alpha_y" in arms[adapted(actor)]


def test_the_real_thing_at_full_size():
    assert all(c.times == tuple(range(100, 10_001, 100)) for c in FIGURE1.conditions)
    for preset in FIGURE1.presets.values():
        assert preset.fresh_seeds == 5
    assert FIGURE1.presets["paper"].interval_seeds == 100
    assert FIGURE1.presets["paper"].without == ()


def test_config_is_json_and_says_what_decides_the_numbers():
    config = STUDIES["figure1"].config("smoke", seed=3)
    assert json.loads(json.dumps(config)) == config
    assert config["seed"] == 3
    assert config != STUDIES["figure1"].config("quick", seed=3)
