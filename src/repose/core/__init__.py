"""What every room needs: errors, files, parameters, responses, targets, runs and their variance, seeds."""
