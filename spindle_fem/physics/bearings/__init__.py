"""Bearing tribology: geometry, lubricant, speed and load to films and heat, term by term."""
