rule shape:
    input:
        berry=rules.berry.output.berry,
        stl=config["berry"]["stl"] or [],
    output:
        stl=f"{RESULTS}/berry/berry.stl",
        particle=f"{RESULTS}/berry/particle.json",
        comparison=f"{RESULTS}/berry/particles.csv",
    log:
        f"{RESULTS}/logs/shape.log",
    benchmark:
        f"{RESULTS}/benchmarks/shape.tsv"
    priority: 1
    resources:
        **resources_for_attempt(700),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("shape"),
        code=code_hash("grain.build"),
    message:
        "Mesh and particle of the grain"
    shell:
        "python -m repose stage shape --config {params.config:q} --berry {input.berry:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


# Grain of every simulation and measurement.
GRAIN = {"berry": rules.berry.output.berry, "particle": rules.shape.output.particle}
