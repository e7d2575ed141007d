"""What a simulation writes and reads: checkpoints, recordings, VTK files, progress."""
