"""The figures of the report as files for print: SVG and PDF, in the sizes of a journal."""
