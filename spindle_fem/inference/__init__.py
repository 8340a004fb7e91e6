"""Where a recording and a model differ, which physics was left out, and how much better it fits with it."""
