"""From measured sizes or a scan to the simulated particle."""
