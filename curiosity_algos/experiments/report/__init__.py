"""One HTML file about many runs, with tables, curves and maps, which needs no network."""

from curiosity_algos.experiments.report.page import write_report

__all__ = ["write_report"]
