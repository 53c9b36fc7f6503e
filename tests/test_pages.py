"""The code of the pages on controllers and on logged data, run as a reader would."""

import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

DOCS = Path(__file__).parents[1] / "docs"


def run(page, names):
    """All its blocks one after another; what it prints, by the page."""
    text = (DOCS / page).read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    for block in blocks:
        exec(compile(block, page, "exec"), names)
    return re.findall(r"```text\n(.*?)```", text, flags=re.DOTALL)


@pytest.mark.slow
def test_logged_data_learns_what_the_page_shows(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown, *_ = run("logged_data.md", names := {})
    said, expected = (float(x.split()[1]) for x in (capsys.readouterr().out, shown))
    # the same keys and data on every machine: only rounding differs
    assert said == pytest.approx(expected, abs=0.03)
    a, b, gamma = 0.8, 0.5, 0.9
    A, B, R = np.eye(1) * a * gamma**0.5, np.eye(1) * b * gamma**0.5, 0.1 * np.eye(1)
    P = solve_discrete_are(A, B, np.eye(1), R)
    best = -(B * P * A / (R + B * P * B)).item()
    assert f"gives the gain {best:.2f};" in (DOCS / "logged_data.md").read_text(encoding="utf-8")
    assert names["data"].action.max() <= 1


def test_the_controllers_of_the_page_are_learners():
    names: dict = {}
    run("controllers.md", names)
    state = names["learner"].init(jax.random.key(0))
    assert names["learner"].greedy(state, jnp.zeros(2)).shape == (1,)
