"""What ``import spindle_fem`` gives: functions that answer with results to look at, plot and save."""
