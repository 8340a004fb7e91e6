"""Laws of bearings, coolant and surroundings, independent of any mesh."""
