"""Few pours, each where it says most: a space-filling start, then batches where the targets are probably met."""
