"""What a run found, in the files of other libraries: a Minari dataset."""

from curiosity_algos.experiments.export.minari_dataset import export_minari

__all__ = ["export_minari"]
