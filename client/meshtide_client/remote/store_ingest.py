"""Ingest into a store and a catalogue, without a server that takes uploads.

The work is done by whatever is registered as `store` in the group of entry points ``meshtide.ingest``: the server's
package does so, which this one must not import. What is asked of it is written down here, in `StoreIngest`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from meshtide_client.other_packages import offered
from meshtide_client.remote.ingest_plan import Ingested, IngestPlan

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    from meshtide_client.remote.ingest_plan import Known, Sending

GROUP = "meshtide.ingest"
NAME = "store"


class StoreIngest(Protocol):
    """What the entry point makes of its options."""

    def known(self) -> Sequence[Known]:
        """The meshes in the catalogue.

        Raises:
            MeshtideError: it cannot be read.
        """

    def run(
        self,
        files: Iterable[Sending],
        report: Callable[[Path, str | None, str, str | None, tuple[str, ...]], None],
        stage: Callable[[str], None],
    ) -> None:
        """Encode files and publish them.

        Args:
            files: taken one by one, when there is somebody to encode them.
            report: called for each file that is done, with the fields of `Ingested`.
            stage: called now and then with what is being done.

        Raises:
            MeshtideError: no file could be tried.
        """


def find_store_ingest() -> Callable[..., StoreIngest]:
    """What makes a `StoreIngest` of options.

    Raises:
        OptionError: there is none, because the server's package is not installed.
    """
    found: Callable[..., StoreIngest] = offered(
        GROUP,
        NAME,
        missing="ingest into a store needs the package meshtide_server, which is not installed here",
        remedy="install it, or upload to a server with --server",
    )
    return found


def ingest_into_store(
    files: Sequence[Path],
    options: dict[str, Any],
    *,
    replace: bool = False,
    progress: Callable[[Ingested], None] = lambda _: None,
    stage: Callable[[str], None] = lambda _: None,
) -> list[Ingested]:
    """Encode files and publish them in a store and a catalogue.

    Args:
        files: to be published.
        options: where to, how they are encoded, and by whom; see `meshtide_server.bulk_ingest.bulk_ingest.BulkIngest`.
        replace: whether what is there already is made again; see `IngestPlan`.
        progress: called for each file that is done.
        stage: called now and then with what is being done.

    Raises:
        OptionError: an option is wrong, or there is nobody who can do it.
        MeshtideError: store, catalogue or cluster cannot be used.

    Returns:
        What became of each file, in their order.
    """
    work = find_store_ingest()(**options)
    results: dict[Path, Ingested] = {}

    def report(result: Ingested) -> None:
        results[result.file] = result
        progress(result)

    plan = IngestPlan(files, work.known(), replace=replace, report=report)
    work.run(plan.to_send(), lambda *fields: report(Ingested(*fields)), stage)
    plan.report_twins(results)
    return [results[file] for file in files]
