"""Figures for print, as SVG and PDF."""

from imubench_pipeline.registry import Extension

EXTENSION = Extension(
    name="figures",
    rules="rules.smk",
    drawings=("figures.figures:list_drawings",),
    theory_figure="figures.figures:encode_theory",
    commands={"figures": "figures.command:COMMAND"},
)
