"""The report of a study: one page for a browser that needs no network.

`page.write_report` writes it.
"""
