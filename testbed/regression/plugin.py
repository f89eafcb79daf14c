"""The pytest plugin: `def test_x8(fidelity_baseline): fidelity_baseline.check("x8-head-on")`.

Pytest loads it in every project that has the testbed installed: everything heavy is imported in `check`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest


class FidelityBaseline:
    """Baselines of the project under test.

    folder  where they are: the same as for `testbed regress` run at pytest's root directory
    """

    def __init__(self, root: Path) -> None:
        self._root = root

    @property
    def folder(self) -> Path:
        from testbed.regression.baseline import folder

        return folder(self._root)

    def check(
        self,
        name: str,
        *,
        block: int = 1,
        overrides: Sequence[str] = (),
        workers: int | None = 1,
        parts: Sequence[str] = (),
    ) -> None:
        """Fail the test, with the table of `testbed regress check`, if baseline `name` has degraded.

        block, overrides, workers, parts  as that command's --block, --set, --workers and --parts
        """
        __tracebackhide__ = True
        from testbed.components.components import Parts
        from testbed.components.named_parts import read
        from testbed.errors import UserError
        from testbed.regression.check import check

        try:
            own = Parts.of(read(parts)) if parts else None
            report = check(self.folder, name, block=block, overrides=overrides, workers=workers, parts=own)
        except UserError as error:
            pytest.fail(str(error), pytrace=False)
        if report.degraded:
            pytest.fail(report.text(), pytrace=False)


@pytest.fixture(scope="session")
def fidelity_baseline(request: pytest.FixtureRequest) -> FidelityBaseline:
    """The project's fidelity baselines: `fidelity_baseline.check("NAME")` flies one and judges it."""
    return FidelityBaseline(request.config.rootpath)
