"""Input and output of a simulation: checkpoints, recordings, VTK files, progress."""
