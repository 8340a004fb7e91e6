"""What a solved machine knows, as objects, summary, dataset and fields."""
