"""The method's parts beside their alternatives, on the study's own data."""
