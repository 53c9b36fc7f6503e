"""The README's examples, run as a reader would; its numbers, those of the committed results."""

import json
import re
import shlex
import sys
from pathlib import Path

import gymnasium
import pytest

from detpg.cli import main

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
READING = "isotropic/score-times-q/mean/sigma-0.1"


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README.read_text(), flags=re.DOTALL)


def test_the_python_example_runs(capsys: pytest.CaptureFixture[str]):
    (code,) = (block for block in blocks("python") if "import detpg" in block)
    exec(compile(code, "README.md", "exec"), {})
    said = capsys.readouterr().out
    cost = float(said.rsplit(" ", 1)[1])
    assert 0 < cost < 1e-2


def plain(line: str) -> str:
    """Without its numbers."""
    return re.sub(r"-?\d[\d,.]*", "#", line)


def test_an_environment_of_one_s_own_is_trained_in_as_shown(tmp_path, monkeypatch, capsys):
    """In fewer steps, with lines as long as they like."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("COLUMNS", "1000")
    (code,) = (block for block in blocks("python") if "gymnasium.Env" in block)
    Path("cart.py").write_text(code)
    (command,) = (line for block in blocks("sh") for line in block.splitlines() if "cart:" in line)
    words = shlex.split(command)
    assert words[:2] == ["detpg", "train"]
    assert words[-2] == "--steps"
    main([*words[1:-1], "1000"])
    captured = capsys.readouterr()
    (shown,) = blocks("text")
    printed = set(map(plain, [*captured.out.splitlines(), *captured.err.splitlines()]))
    assert [line for line in shown.splitlines() if plain(line) not in {*printed, "[...]"}] == []
    sys.modules.pop("cart")
    gymnasium.registry.pop("Cart-v0")


def rows(heading: str) -> list[list[str]]:
    """Cells of the table under a heading."""
    text = README.read_text().split(heading, 1)[1]
    found = re.search(r"(?:^\|.*\n)+", text, flags=re.MULTILINE)
    assert found is not None
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in found[0].splitlines()]


def numbers(words: str) -> list[float]:
    return [float(found.replace(",", "")) for found in re.findall(r"-?\d[\d,.]*\d|\d", words)]


def test_the_numbers_of_figure_1_are_the_committed_ones():
    claims = json.loads((ROOT / "results/figure1/summary.json").read_text())["claims"]
    by_id = {claim["id"]: claim for claim in claims}
    names = [f"ratio-{t}/m-{m}/{READING}" for t in (10_000, 600) for m in (10, 25, 50)]
    names += [f"growth/{READING}", "fixed-both-0.1/m-50/isotropic/score-times-q"]
    names += ["fixed-growth/isotropic/score-times-q"]
    for name, row in zip(names, rows("**Figure 1 of the paper")[2:], strict=True):
        claim, published = by_id[name], numbers(row[2])
        expected = [claim["measured"], *claim["interval"]]
        assert numbers(row[3]) == pytest.approx(expected, rel=6e-3), name
        if published:
            low, high = claim["interval"]
            inside = published[0] / 3 <= low and high <= published[0] * 3
            assert row[4].startswith("yes" if inside else "no"), name
    words = r"(\d+) of (\d+) claims count as reproduced,\s(\d+) do not, (\d+) stay open"
    counts = re.search(words, README.read_text())
    assert counts is not None
    verdicts = [claim["verdict"] for claim in claims]
    kinds = ("reproduced", "not reproduced", "inconclusive")
    reproduced, not_reproduced, open_ = map(verdicts.count, kinds)
    assert [*map(int, counts.groups())] == [reproduced, len(claims), not_reproduced, open_]


def test_its_links_lead_somewhere():
    prose = re.sub(r"```.*?```", "", README.read_text(), flags=re.DOTALL)
    targets = re.findall(r"\]\(([^)#]+)\)", prose) + re.findall(r'src="([^"]+)"', prose)
    assert len(targets) > 8
    for target in targets:
        if not target.startswith("http"):
            assert (README.parent / target).exists(), target
