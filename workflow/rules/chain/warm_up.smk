# The engine is compiled once, before the first run, by a process on each core, and its time is in the log and the benchmark. The
# compiled code lies in the user's cache, not among the results. So runs wait for this rule, and do not run again
# because it is new. The output's name contains the engine's hash: another engine is another file. Were it the same file made anew, snakemake
# would not look for the reasons that the runs behind it have of their own.
rule warm_up:
    input:
        **GRAIN,
    output:
        ready=touch(f"{RESULTS}/berry/engine_{source_hash()}_is_compiled"),
    log:
        f"{RESULTS}/logs/warm_up.log",
    benchmark:
        f"{RESULTS}/benchmarks/warm_up.tsv"
    priority: 1
    threads: 2
    resources:
        **resources_for_attempt(1500, minutes=20),
    params:
        config=CONFIG,
    message:
        "Compiling the engine"
    shell:
        "python -m repose stage warm_up --config {params.config:q} --berry {input.berry:q} --particle {input.particle:q}"
        " --cores {threads:q} > {log:q} 2>&1"


# Inputs of every simulation besides its samples.
READY = GRAIN | {"ready": ancient(rules.warm_up.output.ready)}
