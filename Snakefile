# So that `snakemake --cores 2` finds the workflow from here, too; it is workflow/Snakefile.
include: "workflow/Snakefile"


# An included file does not say what is made by default, even where it names a default target: its includer does.
rule everything:
    default_target: True
    input:
        rules.all.input,
