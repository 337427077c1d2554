"""`imubench demo`: the simulated demonstration, or the analysis of a real log."""

import argparse
import tarfile
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from imubench_pipeline.run import project
from imubench_pipeline.run.analysis import command as analysis
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.tables.outputs import OutputFolder, add_output, check_outputs
from imubench_pipeline.tables.seals import compute_digest


@dataclass(frozen=True)
class RealLog:
    """A published log, which the user downloads; it is no part of this package."""

    subject: str
    command: str  # downloads the file
    file: str
    size: int  # bytes
    digest: str  # SHA-256
    licence: str
    member: str  # the log in that archive
    sensor: Path  # sensor file


REAL_LOG = RealLog(
    subject="a Samsung Galaxy S5 at rest, 5.97 h at 10 Hz, six axes",
    command="pip download --no-deps --no-binary :all: scikit-diveMove==0.4.0",
    file="scikit_divemove-0.4.0.tar.gz",
    size=34_603_527,
    digest="58dd5a2afa804df76f43c6ab785448cd7ff61a47142dd5771f63dc16d29add45",
    licence="AGPL-3.0, test data of scikit-diveMove by Sebastian Luque",
    member="scikit_divemove-0.4.0/skdiveMove/tests/data/samsung_galaxy_s5.nc",
    sensor=Path(__file__).with_name("lab") / "galaxy_s5.yaml",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.description = (
        "Compare simulated sensors in a folder of its own (a few minutes), or with --real analyse "
        "a published log of a real sensor."
    )
    add_output(
        parser,
        "folder",
        partial(OutputFolder, shared=True),
        nargs="?",
        default=Path("imubench_demo"),
        help="where the results go; default: imubench_demo",
    )
    parser.add_argument(
        "--real",
        nargs="?",
        type=Path,
        const=Path(),
        metavar="FILE",
        help=f"{REAL_LOG.file}, as you downloaded it; without FILE: print where to get it",
    )
    parser.add_argument(
        "-c", "--cores", default="all", metavar="N", help="cores for snakemake; default: all"
    )


def run(options: argparse.Namespace) -> int:
    """Make the demonstration; return the exit status."""
    output: OutputFolder = options.folder
    if options.real is None:
        if not (output.path / "config/simulated.yaml").is_file():
            project.init(argparse.Namespace(folder=output, demonstration=True))
        print(f"{output.path}: the report will be results/report/index.html", flush=True)
        return project.run(
            argparse.Namespace(folder=output.path, cores=options.cores, flags=options.flags)
        )
    if options.real == Path():
        print(describe(REAL_LOG, output.path))
        return 0
    return analyse_real_log(REAL_LOG, options.real, output.path)


def describe(log: RealLog, folder: Path) -> str:
    """Return in five lines what the log is, and how to get and analyse it."""
    return "\n".join(
        [
            f"Log: {log.subject}",
            f"Licence: {log.licence}; not included in this package",
            f"Download ({log.size / 1e6:.1f} MB): {log.command}",
            f"SHA-256: {log.digest}",
            f"Then, with the extra hdf5: imubench demo {folder} --real {log.file}",
        ]
    )


def analyse_real_log(log: RealLog, file: Path, folder: Path) -> int:
    """Analyse the log in a downloaded file; return the exit status.

    Raises ConfigError if the file is not the declared one.
    """
    found = file.stat().st_size
    if found != log.size or compute_digest(file) != log.digest:
        raise ConfigError(
            f"{file}: found {found} bytes that are not {log.file}; expected {log.size} bytes with "
            f"SHA-256 {log.digest}: download the file with {log.command}"
        )
    with tempfile.TemporaryDirectory(prefix="imubench.") as scratch:
        with tarfile.open(file) as archive:
            archive.extract(log.member, scratch, filter="data")
        parser = argparse.ArgumentParser()
        analysis.add_arguments(parser)
        words = [str(Path(scratch, log.member)), "--sensor", str(log.sensor), "--at-rest"]
        options = parser.parse_args([*words, "--output", str(folder)])
        check_outputs(options, project.find_protected_places)
        return analysis.run(options)
