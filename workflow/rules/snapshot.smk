# Only on request, `snakemake snapshot --cores 2`: the files of a finished study that a repository keeps. The folder itself is no
# output: snakemake empties the folders that are outputs, whatever they hold.
rule snapshot:
    input:
        [getattr(rules, name).input for name in PRODUCTS],
        rules.page.output,
        card=rules.card.output.card,
    output:
        files=f"{RESULTS}/snapshot.txt",
    log:
        f"{RESULTS}/logs/snapshot.log",
    resources:
        **needs(250),
    params:
        results=lambda wildcards, input: os.path.dirname(input.card),
        folder=f"results/published/{config['label']}",
        keep=lambda wildcards: results_to_keep(),
        studies=lambda wildcards: snapshot.of_optional_studies(
            RESULTS,
            results_to_keep(),
            [
                *(CHAIN if "calibration" in PRODUCTS else []),
                *(CONFIG, *PAGE.values(), *FIGURES_OF_ALL),
            ],
            config["strategy"],
        ),
    message:
        "Snapshot of tables and figures: {params.folder}"
    shell:
        "(python -m repose stage snapshot {params.results:q} --out {params.folder:q} --keep {params.keep:q}"
        " | python -m repose stage write --out {output.files:q}) 2> {log:q}"
