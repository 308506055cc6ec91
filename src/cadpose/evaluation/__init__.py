"""Tables over labelled photographs: rotation, retrieval, and the time each stage takes."""
