"""`detpg render` through its entry point: what it writes, and what it refuses."""

from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from PIL import Image, ImageSequence

from detpg.cli import main
from detpg.workbench import Config, OpenedRun
from films import read_mp4
from made_runs import FakeRun, write_run

KEPT = Path(__file__).parents[2] / "results" / "figure3" / "policy.npz"


def frames(path: Path) -> list[np.ndarray]:
    with Image.open(path) as film:
        pictures = []
        for number in range(getattr(film, "n_frames", 1)):
            film.seek(number)
            pictures.append(np.asarray(film.convert("RGB")))
    return pictures


def seconds(path: Path) -> float:
    """Pictures that are alike are stored once, and shown for longer."""
    with Image.open(path) as film:
        return sum(frame.info["duration"] for frame in ImageSequence.Iterator(film)) / 1000


@pytest.mark.parametrize("world", ["mountain-car", "octopus-arm", "pendulum", "puddle-world"])
def test_a_film_of_each_world(world, tmp_path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "film.gif"
    main(["render", world, "--output", str(path), "--steps", "3"])
    assert capsys.readouterr().out == f"written to {path}: 3 steps\n"
    pictures = frames(path)
    assert {picture.shape for picture in pictures} == {(480, 480, 3)}
    assert seconds(path) == pytest.approx(4 / 20)
    assert np.any(pictures[0] != pictures[-1])
    assert [found.name for found in tmp_path.iterdir()] == ["film.gif"]


def test_mp4_is_what_there_is_by_default(tmp_path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    main(["render", "pendulum", "--steps", "2"])
    assert (tmp_path / "pendulum.mp4").read_bytes()[4:8] == b"ftyp"


def test_a_picture_of_the_last_state(tmp_path):
    path = tmp_path / "end.PNG"
    main(["render", "pendulum", "--policy", "zero", "--output", str(path), "--steps", "1"])
    (early,) = frames(path)
    main(["render", "pendulum", "--policy", "zero", "--output", str(path), "--steps", "9"])
    (late,) = frames(path)
    assert np.any(early != late)
    main(["render", "pendulum", "--policy", "zero", "--output", str(path), "--steps", "1"])
    np.testing.assert_array_equal(frames(path)[0], early)


def test_the_seed_and_the_hold_matter(tmp_path):
    path, seen = tmp_path / "end.png", []
    for words in (
        ("--seed", "1"),
        ("--seed", "1"),
        ("--seed", "2"),
        ("--seed", "1", "--hold", "1"),
    ):
        main(["render", "pendulum", "--output", str(path), "--steps", "20", *words])
        seen.append(path.read_bytes())
    assert seen[0] == seen[1]
    assert len(set(seen)) == 3


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["squid"], "environment 'squid' is unknown: choose from mountain-car, octopus-arm, "),
        (["lqr"], "environment 'lqr' has no picture: choose from mountain-car, octopus-arm, "),
        (["pendulum", "--output", "film.avi"], "film.avi is of no known kind: let it end with"),
        (["pendulum", "--output", "film"], "film is of no known kind: let it end with"),
        (["pendulum", "--output", "none/film.gif"], "cannot be written to (No such file or dir"),
        (["pendulum", "--output", "folder.gif"], "cannot be written to (is a folder)"),
        (["pendulum", "--steps", "0"], "--steps 0 cannot be used: give 1 to 10000."),
        (["pendulum", "--seed", "-1"], "--seed -1 cannot be used: give 0 to 2147483647."),
        (["pendulum", "--hold", "0"], "--hold 0 cannot be used: give 1 to 10000."),
        (["pendulum", "--policy", "best"], "--policy best cannot act in an environment: choose"),
        (["pendulum", "--policy", "a.npz"], "--policy a.npz cannot act in an environment: choose"),
        (["octopus-arm", "--policy", "a.npz"], "a.npz is missing, damaged, or of another policy"),
        (["folder.gif"], "folder.gif is not a run: name a folder that `detpg train` has written."),
        (["folder.gif", "--policy", "zero"], "--policy zero is not of a run: choose best or last."),
    ],
)
def test_what_cannot_be_used_is_refused(
    words, said, tmp_path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.gif").mkdir()
    with pytest.raises(SystemExit) as ended:
        main(["render", *words])
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert [found.name for found in tmp_path.iterdir()] == ["folder.gif"]


def test_the_last_picture_is_of_the_last_step(tmp_path):
    """A film's last picture and the still are one."""
    still, film = tmp_path / "end.png", tmp_path / "film.gif"
    for path in (still, film):
        main(["render", "octopus-arm", "--output", str(path), "--steps", "3"])
    # A gif has few colours; the words and the path of the tip are there or not.
    difference = frames(still)[0].astype(int) - frames(film)[-1]
    assert np.mean(np.abs(difference) > 40) < 1e-3


def test_what_figure_3_has_kept_strikes_the_target(tmp_path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "strike.png"
    main(["render", "octopus-arm", "--policy", str(KEPT), "--output", str(path)])
    steps = int(capsys.readouterr().out.split()[-2])
    assert 1 < steps < 100
    r, g, b = np.moveaxis(frames(path)[0].astype(int), 2, 0)
    assert np.any((g > r + 60) & (g > b + 30))  # the target turns green when it is hit


@pytest.fixture
def opened(tmp_path, monkeypatch: pytest.MonkeyPatch):
    """Puts a run where the command finds it."""

    def put(**config):
        path = write_run(tmp_path / "run", **config)
        run = FakeRun(path)
        monkeypatch.setattr("detpg.workbench.open_run", lambda path, own: run, raising=False)
        monkeypatch.chdir(tmp_path)
        return run

    return put


def test_a_run_is_filmed_by_its_world(opened, capsys: pytest.CaptureFixture[str]):
    run = opened()
    main(["render", "run", "--index", "2", "--seed", "4", "--steps", "3"])
    assert run.asked == {"which": "best", "index": 2, "seed": 4, "max_steps": 3}
    assert capsys.readouterr().out == "written to run.mp4: 3 steps\n"
    pictures, fps = read_mp4(Path("run.mp4"))
    assert (len(pictures), pictures[0].shape, fps) == (4, (42, 62, 3), 12.5)  # 41 by 61 before
    np.testing.assert_allclose(pictures[-1], 60, atol=3)
    main(["render", "run/", "--policy", "last", "--output", "end.png"])
    assert run.asked == {"which": "last", "index": None, "seed": 0, "max_steps": 1000}
    assert np.all(frames(Path("end.png"))[0] == 100)


class Drawing(gymnasium.Env):
    """Floats in 0 to 1 with an opacity, of an odd size: darker step by step."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 12.5}  # noqa: RUF012
    observation_space = action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))

    def __init__(self, render_mode=None):
        self.render_mode = render_mode

    def reset(self, *, seed=None, options=None):
        self.steps = 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.steps += 1
        return np.zeros(1, np.float32), 0.0, False, False, {}

    def render(self):
        return np.full((31, 45, 4), [1 - self.steps / 5, 0.5, 0.5, 1.0])


class Typing(Drawing):
    def render(self):
        return "a picture" if self.steps else super().render()


@pytest.fixture
def run_in(opened, monkeypatch: pytest.MonkeyPatch):
    """Puts a run in a world where the command finds it, with a policy that does nothing."""

    def put(world):
        opened()
        monkeypatch.setitem(gymnasium.registry, "Drawing-v0", EnvSpec("Drawing-v0", world))
        run = OpenedRun.__new__(OpenedRun)
        run.path, run._own = Path("run"), None
        run.config = Config("opdac", "Drawing-v0", time_limit=9)
        monkeypatch.setattr(run, "controller", lambda *_: lambda seen: seen * 0, raising=False)
        monkeypatch.setattr("detpg.workbench.open_run", lambda path, own: run, raising=False)

    return put


@pytest.mark.parametrize("kind", ["mp4", "gif", "png"])
def test_what_a_world_draws_is_in_the_film(kind, run_in):
    run_in(Drawing)
    path = Path(f"film.{kind}")
    main(["render", "run", "--steps", "3", "--output", str(path)])
    pictures, pace = read_mp4(path) if kind == "mp4" else (frames(path), 12.5)
    assert len(pictures) == (1 if kind == "png" else 4)
    assert pictures[0].shape == ((32, 46, 3) if kind == "mp4" else (31, 45, 3))
    assert pace == 12.5
    assert kind != "gif" or seconds(path) == pytest.approx(4 / 12.5)
    for step, picture in zip([3] if kind == "png" else range(4), pictures, strict=True):
        np.testing.assert_allclose(picture[5, 5], [255 - 51 * step, 128, 128], atol=4)


@pytest.mark.parametrize("kind", ["mp4", "gif", "png"])
def test_what_is_no_picture_is_written_nowhere(kind, run_in, capsys):
    run_in(Typing)
    Path(f"film.{kind}").write_bytes(b"before")
    with pytest.raises(SystemExit) as ended:
        main(["render", "run", "--steps", "3", "--output", f"film.{kind}"])
    assert ended.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == (
        "detpg: Frame 1 of Drawing-v0 is a str: let render() return uint8 of shape (height, width, "
        "3).\n"
    )
    assert Path(f"film.{kind}").read_bytes() == b"before"


def test_a_run_in_a_world_of_ours_is_drawn_by_us(opened):
    run, ends = opened(environment="pendulum"), {}
    for policy in ("best", "last"):
        main(["render", "run", "--policy", policy, "--output", "end.png", "--steps", "9"])
        assert run.asked == {"which": policy, "index": None}
        ends[policy] = frames(Path("end.png"))[0]
    assert ends["best"].shape == (480, 480, 3)
    assert np.any(ends["best"] != ends["last"])


@pytest.mark.parametrize(
    ("config", "words", "said"),
    [
        ({}, ["--index", "3"], "--index 3 cannot be used: run has 3 training seeds, the first"),
        ({}, ["--policy", "random"], "--policy random is not of a run: choose best or last."),
        ({"environment": "lqr"}, [], "environment 'lqr' has no picture: choose from"),
        ({"environment": "Blind-v0"}, [], "Blind-v0 has no picture: it knows no rgb_array."),
    ],
)
def test_a_run_that_cannot_be_filmed(
    config, words, said, opened, capsys: pytest.CaptureFixture[str]
):
    opened(**config)
    with pytest.raises(SystemExit) as ended:
        main(["render", "run", *words])
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not Path("run.mp4").exists()


def test_what_is_there_survives_a_failure(tmp_path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "film.gif"
    path.write_bytes(b"before")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("detpg.runs.directory.os.fsync", full)
    with pytest.raises(SystemExit) as ended:
        main(["render", "pendulum", "--output", str(path), "--steps", "1"])
    assert ended.value.code == 2
    assert path.read_bytes() == b"before"
    assert len(list(tmp_path.iterdir())) == 1
