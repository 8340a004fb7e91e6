"""Results of a solved machine as objects, summary, dataset and fields."""
