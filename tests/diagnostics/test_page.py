"""The example on the documentation's page, run as a reader would."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "diagnostics.md"


def numbers(text: str) -> dict[str, tuple[float, float]]:
    """Each line's name, value and standard error."""
    lines = re.findall(r"^(.+): (-?[\d.]+) \+- ([\d.]+)$", text, flags=re.MULTILINE)
    return {name: (float(value), float(error)) for name, value, error in lines}


@pytest.mark.slow
def test_the_example_prints_what_the_page_shows(capsys: pytest.CaptureFixture[str]):
    page = PAGE.read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    (shown,) = re.findall(r"```text\n(.*?)```", page, flags=re.DOTALL)
    exec(compile(code, "diagnostics.md", "exec"), {})
    said, expected = numbers(capsys.readouterr().out), numbers(shown)
    assert list(said) == list(expected) == ["not in the span", "scale", "cosine", "variance"]
    for name, (value, error) in said.items():
        # The same keys on every machine: only rounding differs, which the errors are far above.
        assert value == pytest.approx(expected[name][0], abs=error), name
