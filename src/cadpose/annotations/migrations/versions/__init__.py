"""One file a revision, in order; what a revision does never changes once it is published."""
