"""Join the tables of all sensors, as Parquet and CSV, and describe all tables of a run."""

import json
from pathlib import Path

from imubench_pipeline.steps.tables import join_all_tables, remove_parts, write_parts
from imubench_pipeline.tables.datapackage import describe_tables
from imubench_pipeline.tables.files import write_arrow, write_json

if __name__ == "__main__":
    inputs = {name: [Path(path) for path in paths] for name, paths in snakemake.input.items()}
    params = snakemake.params
    joined = join_all_tables(inputs)
    for output in map(Path, snakemake.output):
        if output.suffix == ".json":
            write_json(describe_tables(json.loads(params.software), params.csv), output)
        elif output.suffix == ".parquet" and output.stem in params.parts:
            write_parts(joined[output.stem], output, joined["recordings"])
        else:
            if output.stem not in params.parts:  # a table in parts may have a CSV file, too
                remove_parts(output)
            write_arrow(joined[output.stem], output)
