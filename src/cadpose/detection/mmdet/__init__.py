"""DetectoRS, the detector of the paper, as OpenMMLab's mmdetection builds it; an optional extra.

Their Python packages are used as published. What they compile is given here in PyTorch.
"""
