# Only on request, `snakemake --cores 2 snapshot`: what a repository keeps of a finished study.
rule snapshot:
    input:
        rules.calibration.input,
        rules.figures.input,
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
        results=RESULTS,
    message:
        "Snapshot of tables and figures: {output}"
    shell:
        "python -m repose snapshot {params.results} --out {output} > {log} 2>&1"
