"""DELF (Noh et al., ICCV 2017): its published network in torch, its weights read without TensorFlow.

Rebuilt from the paper and from the facts of the authors' code (tensorflow/models, Apache-2.0); none of it is
copied. Nothing here imports torch until a network is asked for.
"""
