"""One HTML file of many runs: tables, curves and maps, without a network."""

from curiosity_algos.experiments.report.page import write_report

__all__ = ["write_report"]
