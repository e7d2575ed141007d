"""Read, complete and check the configuration of a study, and estimate its cost."""
