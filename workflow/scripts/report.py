"""Write the pages of the report whose data changed."""

from pathlib import Path

from imubench_pipeline.report.publish import publish, site_of
from imubench_pipeline.tables import read


def main(tables: list[Path], settings: str, start_page: Path) -> None:
    """Write the report; its start page is the last to appear."""
    folder = start_page.parent
    site = site_of({path.stem: read(path.stem, [path]) for path in tables}, settings, folder.parent)
    publish(site, folder)


if __name__ == "__main__":
    main(
        [Path(path) for path in snakemake.input.tables],
        snakemake.params.settings,
        Path(snakemake.output[0]),
    )
