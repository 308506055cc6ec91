"""What makes the weights: synthetic photos, networks, losses, loops. Inference imports nothing from here."""
