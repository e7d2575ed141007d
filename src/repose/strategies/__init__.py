"""Other ways to calibrate than the published method, each chosen by the configuration's `strategy`."""
