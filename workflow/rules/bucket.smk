"""Logs and results in an object store, by the storage plugin of Snakemake for S3."""

import os

from imubench_pipeline.settings.validation import ConfigError

LISTING = Path(".snakemake/stored_logs")  # in the folder of the run


class Bucket:
    """The place of a run in a bucket: ``prefix`` is ``s3://bucket/folder``.

    A ConfigError is raised for settings that need a disk.
    """

    def __init__(self, provider, prefix, run):
        self._provider = provider
        self._prefix = prefix.rstrip("/") + "/"
        if not hasattr(provider, "s3c"):
            raise ConfigError(
                "--default-storage-provider: expected s3; for another store, copy the logs to a disk"
            )
        for name, path in (("logs", run.logs), ("results", run.results)):
            if path.is_absolute() or ".." in path.parts:
                raise ConfigError(
                    f"{name}: found {str(path)!r}; expected a relative path, which is a place "
                    f"below {self._prefix}"
                )
        if run.reconstruction.keep_series:
            raise ConfigError(
                "reconstruction: keep_series: found true; expected false where the results are in "
                "an object store: the series are no declared outputs"
            )
        self._places = {
            LISTING.absolute() / run.logs: run.logs,
            self.find_copy(run.results): run.results,
        }
        self.logs, self.results = self._places
        """Folders on this machine: names and sizes of the logs, and copies of results in use."""

    def find_copy(self, place):
        """Return the path on this machine of the copy of an object."""
        return Path(self._provider.object(f"{self._prefix}{place}").local_path())

    def find_places(self, paths):
        """Return the places below the prefix of files of a `Plan`."""
        folders = self._places.items()
        return [
            str(place / path.relative_to(folder))
            for path in paths
            for folder, place in folders
            if path.is_relative_to(folder)
        ]

    def list_logs(self):
        """Make a file of the name and size of each log, without its content; copy the notes."""
        root = self._provider.object(f"{self._prefix}{self._places[self.logs]}")
        begin, paths = f"{root.key}/", set()
        for item in root.s3bucket().objects.filter(Prefix=begin):
            if item.key.endswith("/") or ".." in Path(item.key).parts:
                continue  # no file has this name
            path = self.logs / item.key.removeprefix(begin)
            paths.add(path)
            date = item.last_modified.timestamp()
            if path.is_file() and (path.stat().st_size, path.stat().st_mtime) == (
                item.size,
                date,
            ):
                continue
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.suffix.lower() in (".yaml", ".yml"):
                item.Object().download_file(path)
            else:
                with path.open("wb") as file:
                    file.truncate(item.size)
            os.utime(path, (date, date))
        for path in {
            file for file in self.logs.rglob("*") if not file.is_dir()
        } - paths:
            path.unlink(missing_ok=True)

    def fetch(self, *places):
        """Copy objects below the results to this machine, for people to read."""
        for place in places:
            found = self._provider.object(
                f"{self._prefix}{self._places[self.results]}/{place}"
            )
            if found.exists():
                found.local_path().parent.mkdir(parents=True, exist_ok=True)
                found.retrieve_object()
