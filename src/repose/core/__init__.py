"""Modules that every room uses: errors, files, parameters, responses, targets, runs and their variance, seeds."""
