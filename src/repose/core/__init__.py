"""What every room needs: errors, files, the six parameters."""
