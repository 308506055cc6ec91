"""PoseContrast (Xiao, Du, Marlet, 3DV 2021): network, augmentation, training, weights, export.

Written anew from the paper and from the facts of the authors' code (MIT licence); none of it is copied.
"""
