"""What every room shares: errors, files, tables of users, sections of the configuration, records of results."""
