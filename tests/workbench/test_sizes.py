"""What would not fit is counted exactly and refused in one sentence, before it is laid out."""

import jax
import pytest

from detpg.types import EnvironmentSpec
from detpg.workbench import Config, sizes
from detpg.workbench.learners import bare, learner

EIGHT = EnvironmentSpec("eight", 8, 2, (-1.0,) * 2, (1.0,) * 2, 100, 0.9)
CAMERA = EnvironmentSpec("camera", 21168, 2, (-1.0,) * 2, (1.0,) * 2, 100, 0.9)
GB = 10**9


@pytest.fixture(autouse=True)
def free(monkeypatch):
    """A machine on which 16 GB are free, unless a test says otherwise."""

    def leave(size):
        monkeypatch.setattr(sizes, "memory", lambda: size)

    leave(16 * GB)
    return leave


def refusal(algorithm, spec=EIGHT, **changes):
    with pytest.raises(ValueError) as caught:  # noqa: PT011  (the sentence is read)
        learner(Config(algorithm, "eight", **changes), spec)
    said = str(caught.value)
    assert said.endswith(".")
    assert "\n" not in said
    return said


def test_tiles_of_eight_observed_numbers():
    assert refusal("copdac-q", policy="tiles") == (
        "8 tilings of 8^8 tiles are 134,217,728 weights, 536.8 MB, for each action component or "
        "value, and 8.5 GB while it learns, where 16.0 GB are free and a learner of more than "
        "67,108,864 would take days: let tiles share weights with --hashed 65536, or give fewer "
        "--tiles or --tilings."
    )


@pytest.mark.parametrize(
    ("algorithm", "parts"),
    [
        ("copdac-q", {"value": "tiles"}),
        ("opdac", {"policy": "tiles"}),
        ("stochastic-ac", {"policy": "tiles"}),
        ("offpac", {"policy": "tiles", "normalise": "rewards"}),
        ("copdac-gq", {"policy": "tiles", "value": "tiles"}),
    ],
)
def test_tiles_are_counted_in_every_part(algorithm, parts):
    assert "134,217,728 weights" in refusal(algorithm, **parts)


@pytest.mark.parametrize(
    ("tiles", "size", "said"),
    [(10, 17, "8 tilings of 10^17 tiles are some 10^17 weights"), (9, 21168, "some 10^20200 wei")],
)
def test_counts_that_have_no_32_bit_index_are_refused_too(tiles, size, said):
    spec = EnvironmentSpec("far", size, 1, (-1.0,), (1.0,), 100, 0.9)
    assert said in refusal("copdac-q", spec, policy="tiles", tiles=tiles)


def test_hashed_tiles_share_weights():
    given = Config("copdac-q", "eight", policy="tiles", value="tiles", hashed=512)
    built = bare(given, EIGHT, None)
    state = jax.eval_shape(built.init, jax.random.key(0))
    assert state.theta.shape == (2, 513)
    assert state.v.shape == (513,)
    features = built.policy.features
    assert features.active(jax.numpy.zeros(8)).shape == (9,)


def test_few_tiles_are_as_before():
    policy = bare(Config("copdac-q", "eight", policy="tiles", tiles=2), EIGHT, None).policy
    assert policy.features.size == 8 * 2**8 + 1


@pytest.mark.parametrize(
    ("algorithm", "changes", "said"),
    [
        (
            "opdac",
            {"hidden": (100_000, 100_000)},
            "opdac would hold 10,001,200,482 numbers (10,001,200,002 in its policy, 480 in its "
            "action value), 640.0 GB while 1 learner learns, where 16.0 GB are free and a learner "
            "of more than 67,108,864 would take days: give fewer --hidden or --value-units.",
        ),
        ("opdac", {"value_units": 10**9}, "12,000,000,000 in its action value"),
        ("copdac-q", {"value_units": 10**9}, "10,000,000,001 in its state value"),
        (
            "opdac",
            {"seeds": 10**6},
            "where 16.0 GB are free and a learner of more than 67,108,864 would take days: give "
            "fewer --seeds.",
        ),
    ],
)
def test_units_and_seeds_are_counted(algorithm, changes, said):
    assert said in refusal(algorithm, **changes)


@pytest.mark.parametrize(
    ("algorithm", "changes", "part"),
    [
        ("opdac", {"value": "quadratic"}, "224,116,206 in its action value"),
        ("copdac-q", {"value": "quadratic"}, "224,073,865 in its state value"),
        ("copdac-q", {"policy": "quadratic"}, "448,147,730 in its policy"),
        ("stochastic-ac", {}, "224,073,865 in its features"),
    ],
)
def test_quadratic_parts_of_a_picture_are_counted(algorithm, changes, part):
    said = refusal(algorithm, CAMERA, **changes)
    assert part in said
    assert said.endswith("that grows with the square of what is observed.")


def test_what_is_free_counts(free):
    """54,000 weights of a policy and as many of its critic: 20 seeds take 140 MB."""
    given = Config("copdac-q", "eight", policy="linear", value="tiles", tiles=3, seeds=20)
    learner(given, EIGHT)
    free(50 * 10**6)
    assert "while 20 learners learn, where 50.0 MB are free" in refusal(
        "copdac-q", policy="linear", value="tiles", tiles=3, seeds=20
    )
    free(None)
    learner(given, EIGHT)
    said = refusal("copdac-q", policy="tiles")
    assert "while it learns, where a learner of more than 67,108,864 would take days" in said


@pytest.mark.parametrize("name", ["hidden", "value_units", "tiles", "tilings", "hashed"])
def test_sizes_have_an_end(name):
    value = 2**31
    with pytest.raises(ValueError, match=rf"^{name} = {value} is not usable: give less than 2\^31"):
        Config("opdac", "eight", **{name: (value,) if name == "hidden" else value})


@pytest.mark.parametrize(("value", "said"), [(0, "give 1 or more"), (2.5, "is no whole number")])
def test_hashed_is_a_number_of_weights(value, said):
    with pytest.raises(ValueError, match=rf"^hashed = {value} .*{said}"):
        Config("opdac", "eight", hashed=value)
