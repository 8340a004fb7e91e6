"""Physics that a machine definition may have left out, one small module each."""
