"""What an effect is, and the building blocks that the catalogue is written with."""
