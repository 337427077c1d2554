"""Write the pages of the report whose data changed."""

from pathlib import Path

from imubench_pipeline.report.publish import make_site, publish
from imubench_pipeline.tables.files import read


def write_report(tables: list[Path], settings: str, start_page: Path, processes: int = 1) -> None:
    """Write the report; its start page is the last to appear."""
    folder = start_page.parent
    site = make_site(
        {path.stem: read(path.stem, [path]) for path in tables}, settings, folder.parent
    )
    publish(site, folder, processes=processes)
