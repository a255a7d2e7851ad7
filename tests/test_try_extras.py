"""Each extra works alone, in a clean environment, by what its page tells the reader."""

from __future__ import annotations

import subprocess
import sys

import pytest

from scripts.try_extras import FIRST_USES, NOT_FOR_USERS, FirstUse, declared_extras, first_script
from tests.support import ROOT


def test_every_extra_of_users_has_a_page() -> None:
    assert declared_extras() == set(FIRST_USES) | NOT_FOR_USERS


@pytest.mark.parametrize("use", FIRST_USES.values(), ids=FIRST_USES)
def test_page_has_the_first_use(use: FirstUse) -> None:
    language, script = first_script(use)
    assert language in {"shell", "python"}
    assert all(start in script for start in use.run)


@pytest.mark.parametrize(
    "use",
    [
        FirstUse("docs/guides/gymnasium.md", "rosbridge-sim[missing]", ("import gymnasium",)),
        FirstUse("docs/guides/gymnasium.md", '"rosbridge-sim[gym]"', ("import missing",)),
    ],
    ids=["install", "run"],
)
def test_words_that_a_page_has_not_are_told(use: FirstUse) -> None:
    with pytest.raises(ValueError, match=r"gymnasium\.md: expected .*missing"):
        first_script(use)


@pytest.mark.slow
@pytest.mark.long
def test_extra_of_campaigns_works_alone() -> None:
    """The one that lacked a package. The others have a job each, because an installation takes half a minute."""
    words = [sys.executable, "scripts/try_extras.py", "campaign"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
