"""RF-DETR-Seg (Robinson et al., 2025; Apache-2.0) through transformers: an optional extra."""
