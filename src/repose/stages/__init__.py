"""The stages of the workflow, in the order in which the data flow."""
