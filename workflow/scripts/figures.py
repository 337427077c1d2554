"""Draw the figures of all sensors for print."""

import json
from pathlib import Path

from imubench_pipeline.report.static_figures.of_run import draw_comparison
from imubench_pipeline.tables import making, read

if __name__ == "__main__":
    with making(Path(snakemake.output[0])) as folder:
        draw_comparison(
            {Path(path).stem: read(Path(path).stem, [Path(path)]) for path in snakemake.input},
            json.loads(snakemake.params.settings)["report"]["units"],
            folder,
        )
