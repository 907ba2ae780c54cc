"""What the documentation shows must run."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted(DOCS.glob("*.md"))


def blocks(page: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(), flags=re.DOTALL)


def test_the_example_of_the_fire_alone_runs(capsys):
    example = blocks("fire_alone.md")[0]
    assert len(example.splitlines()) <= 30
    names: dict = {}
    exec(example, names)
    assert re.fullmatch(r"burned: \d+ ha, 5 % to 95 %: \d+ to \d+ ha\n", capsys.readouterr().out)
    probability, area = names["probability"], names["area"]
    assert probability.shape == (64, 64) and probability[32, 15] == 1.0
    assert area.shape == (64, 151) and (area.diff(dim=1) >= 0.0).all() and area[:, -1].mean() > area[:, 0].mean()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_and_picture_of_a_page_is_there(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), target
