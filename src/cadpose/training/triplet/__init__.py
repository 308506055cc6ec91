"""The paper's learned baseline: two VGG16 encoders and a triplet loss (after Langer et al., BMVC 2021).

Written anew from the two papers and from the facts of Langer's published code and of pytorch-NetVlad, on
which that rests; none of it is copied.
"""
