"""Names of the files of a study, for those who write and those who read them."""

SWEEP_SCHEMA = "spindle-fem/sweep/1"
SUMMARY_FILE, STUDY_FILE, MACHINE_FILE = "sweep.json", "study.toml", "machine.toml"
