"""Write the pages of the report whose data changed."""

from pathlib import Path

from imubench_pipeline.report.publish import make_site, publish, render_one_file
from imubench_pipeline.tables.files import read, write_content


def write_report(
    tables: list[Path],
    settings: str,
    start_page: Path,
    processes: int = 1,
    *,
    one_file: bool = False,
) -> None:
    """Write the report; the start page is written last, or with `one_file` contains all pages."""
    folder = start_page.parent
    site = make_site(
        {path.stem: read(path.stem, [path]) for path in tables}, settings, folder.parent
    )
    if one_file:
        write_content(render_one_file(site), start_page)
    else:
        publish(site, folder, processes=processes)
