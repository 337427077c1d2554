"""Figures for print, as SVG and PDF."""

from imubench_pipeline.registry import Extension

EXTENSION = Extension(
    name="figures",
    rules="rules.smk",
    figures={
        "comparison": "figures.figures:list_drawings",
        "theory": "figures.figures:encode_theory",
    },
    commands={"figures": "figures.command:COMMAND"},
)
