"""Opens the executor of many runs: processes on this machine, or a cluster.

    with executor(workers=2) as pool:
        for outcome in pool.imap(measure, jobs):
            print(jobs[outcome.index], outcome.value())

Work is a module's function and is sent by name; a job is data. Every job gets one outcome, in the order in
which jobs end. A job that raises, or crashes its process, is an outcome too; the others go on.
"""

from __future__ import annotations

from testbed.campaigns.outcome import Executor


def executor(workers: int | None = None, cluster: str | None = None) -> Executor:
    """Processes on this machine (`workers`, None: one per processor), or the cluster at an address.

    Raises UserError if the cluster cannot be reached or the extra `cluster` is not installed.
    """
    if cluster is not None:
        from testbed.campaigns.cluster import Cluster

        return Cluster(cluster)
    from testbed.campaigns.processes import Processes

    return Processes(workers)
