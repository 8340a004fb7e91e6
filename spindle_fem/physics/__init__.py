"""Laws of bearings, coolant and surroundings; none of them knows a mesh."""
