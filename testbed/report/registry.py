"""Tells which kind of folder a command wrote, and who makes that folder's part of a page.

A study, or another package above this one, describes its folders as `Kind`s and hands them to
`testbed.report.page.write`; what `report` itself can show is `OWN`. Nothing is imported before a folder of
that kind is met.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from testbed.report.blocks import Part

# (folder, title) -> its part of a page.
Account = Callable[[Path, str], Part]


@dataclass(frozen=True)
class Kind:
    """A kind of folder.

    mark     the file by which it is known
    account  "module:function" of an `Account`
    """

    mark: str
    account: str

    def part(self, folder: Path, title: str) -> Part:
        """The folder's part of a page."""
        module, _, function = self.account.partition(":")
        account: Account = getattr(import_module(module), function)
        return account(folder, title)


OWN = (
    Kind("manifest.json", "testbed.report.run_part:of_folder"),
    Kind("ledger.json", "testbed.report.ledger_part:part"),
    Kind("campaign.json", "testbed.report.campaign_part:part"),
    Kind("overlay.json", "testbed.report.overlay_page:part"),
)


def kind_of(folder: Path, kinds: Iterable[Kind]) -> Kind | None:
    """The first kind whose mark the folder has."""
    return next((kind for kind in kinds if (folder / kind.mark).is_file()), None)
