"""Export of a run to files of other libraries: a Minari dataset, an ONNX graph."""

from curiosity_algos.experiments.export.minari_dataset import export_minari
from curiosity_algos.experiments.export.onnx_graph import export_onnx, policy_graph

__all__ = ["export_minari", "export_onnx", "policy_graph"]
