"""Many photos: annotate each, write its outputs whole, go on after a failure."""
