"""Lists the folders that studies and exports write, for `testbed report`."""

from __future__ import annotations

from testbed.report.registry import Kind

KINDS = (
    Kind("comparison.json", "testbed.studies.comparison.comparison:part"),
    Kind("ladder.json", "testbed.studies.ladder.page:part"),
    Kind("remedies.json", "testbed.studies.remedies.page:part"),
    Kind("margin.json", "testbed.studies.margin.page:part"),
    Kind("answer.json", "testbed.studies.answer.page:part"),
    Kind("tune.json", "testbed.studies.tuning.page:part"),
    Kind("figures.json", "testbed.studies.paper.page:part"),
    Kind("benchmark.json", "testbed.studies.benchmark.page:part"),
    Kind("falsify.json", "testbed.studies.falsify.page:part"),
    Kind("export.json", "testbed.export.page:part"),
)
