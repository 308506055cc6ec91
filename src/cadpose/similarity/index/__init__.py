"""The view index of a whole library: built resumably, asked in milliseconds."""
