"""The embedded rotation network: PoseContrast on an EfficientNet-Lite, trained on synthetic photos."""
