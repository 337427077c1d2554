"""Puts workflow, catalogue and plotly.js with its licence into a wheel; see pyproject.toml."""

import re
import tomllib
from importlib.metadata import distribution
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

PLOTTING = "plotly/package_data/plotly.min.js"
SHIPPED = ("Snakefile", "workflow/**/*", "config/**/*", "profiles/**/*")
_PICTURE = re.compile(r"!\[[^]]*\]\((?!\w+:)[^)]+\)\n\n(\*[^*]+\*\n\n)?")  # with its caption
_LINK = re.compile(r"\[([^]]*)\]\((?!\w+:|#)([^)]+)\)")


def describe(readme: str, files: str | None) -> str:
    """Return the README for a package index, with relative links below an address.

    Without an address, links become text, and pictures and their captions are left out.
    """
    if files is None:
        return _LINK.sub(r"\1", _PICTURE.sub("", readme))
    return _LINK.sub(rf"[\1]({files.rstrip('/')}/\2)", readme)


def read_description() -> str:
    """Return the README of this project with the address of its files in pyproject.toml."""
    project = tomllib.loads(Path("pyproject.toml").read_text("utf-8"))["project"]
    return describe(Path("README.md").read_text("utf-8"), project.get("urls", {}).get("Files"))


class WithProject(build_py):
    """Copies the files of a checkout to where `settings.shipped` looks for them in a wheel.

    In a checkout both they and plotly.js stay where they are.
    """

    def run(self) -> None:
        """Copy the package, and the files."""
        super().run()
        for source, target in self._shipped().items():
            self.mkpath(str(Path(target).parent))
            self.copy_file(source, target, preserve_mode=False)
        for source, target in self._plotting().items():
            self.copy_file(source, target, preserve_mode=False)

    def get_source_files(self) -> list[str]:
        """Return what a source distribution needs."""
        return [*super().get_source_files(), *self._shipped()]

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """Return what is built."""
        added = [*self._shipped().values(), *self._plotting().values()]
        return [*super().get_outputs(include_bytecode), *added]

    def get_output_mapping(self) -> dict[str, str]:
        """Return which file is built of which."""
        shipped = {target: source for source, target in self._shipped().items()}
        return {**super().get_output_mapping(), **shipped}

    def _plotting(self) -> dict[str, str]:
        """Return plotly.js and its licence, and the places where `report.pages` looks for them."""
        if self.editable_mode:
            return {}
        plotly = distribution("plotly")
        licences = [file for file in plotly.files or () if file.name.startswith("LICENSE")]
        if not licences:
            raise FileNotFoundError("plotly: found no LICENSE beside it; its script needs it")
        static = Path(self.build_lib, "imubench_pipeline/report/static")
        return {
            str(plotly.locate_file(PLOTTING)): str(static / "plotly.min.js"),
            str(plotly.locate_file(licences[0])): str(static / "plotly.LICENSE.txt"),
        }

    def _shipped(self) -> dict[str, str]:
        """Return the files and their places in the wheel; in an editable install they stay."""
        if self.editable_mode:
            return {}
        place = Path(self.build_lib, "imubench_pipeline/project")
        files = (path for pattern in SHIPPED for path in sorted(Path().glob(pattern)))
        return {
            str(path): str(place / path)
            for path in files
            if path.is_file() and "__pycache__" not in path.parts
        }


if __name__ == "__main__":
    setup(
        cmdclass={"build_py": WithProject},
        long_description=read_description(),
        long_description_content_type="text/markdown",
    )
