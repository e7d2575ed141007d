"""Design of experiments: the designs of the textbooks, the analysis of variance, steepest ascent, the optimum."""
