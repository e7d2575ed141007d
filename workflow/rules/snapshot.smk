# Only on request, `snakemake snapshot --cores 2`: what a repository keeps of a finished study.
rule snapshot:
    input:
        rules.calibration.input,
        rules.figures.input,
        table4=rules.validate.output.table4,
    output:
        directory(f"results/published/{config['label']}"),
    log:
        f"{RESULTS}/logs/snapshot.log",
    benchmark:
        f"{RESULTS}/benchmarks/snapshot.tsv"
    threads: 1
    resources:
        mem_mb=300,
    params:
        results=lambda wildcards, input: os.path.dirname(os.path.dirname(input.table4)),
    message:
        "Snapshot of tables and figures: {output}"
    shell:
        "python -m repose snapshot {params.results} --out {output} > {log} 2>&1"
