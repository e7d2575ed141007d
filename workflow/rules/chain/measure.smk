# The representative solution's pile, measured from a picture as a photograph is, and a film of its pour.
REPRESENTATIVE = OWN_SOLUTIONS[0]
FILM_SEED = draw_run_seeds(
    config["design"]["seed"], "validation", int(REPRESENTATIVE), 1
)[0]


rule measure:
    input:
        **GRAIN,
        heap=f"{RESULTS}/validation/heaps/{REPRESENTATIVE}.npz",
    output:
        silhouette=f"{RESULTS}/measure/silhouette.png",
        overlay=f"{RESULTS}/measure/overlay.png",
        result=f"{RESULTS}/measure/measured.json",
    log:
        f"{RESULTS}/logs/measure.log",
    benchmark:
        f"{RESULTS}/benchmarks/measure.tsv"
    resources:
        **resources_for_attempt(300),
    params:
        config=CONFIG,
        code=code_hash("measure.saved_piles", "measure.pile"),
        settings=select_stage_settings("silhouette"),
    message:
        "Measuring the pile in one side view"
    shell:
        "(python -m repose stage silhouette {input.heap:q} --config {params.config:q} --particle {input.particle:q}"
        " --out {output.silhouette:q};"
        " python -m repose stage measure_silhouette {output.silhouette:q} --config {params.config:q}"
        " --berry {input.berry:q} --overlay {output.overlay:q} --out {output.result:q}) > {log:q} 2>&1"


use rule pour as trajectory with:
    input:
        **READY,
        samples=rules.solutions.output.solutions,
    output:
        trajectory=f"{RESULTS}/film/{REPRESENTATIVE}_trajectory_{FILM_SEED}.npz",
    log:
        f"{RESULTS}/logs/trajectory.log",
    benchmark:
        f"{RESULTS}/benchmarks/trajectory.tsv"
    resources:
        **resources_for_attempt(350, minutes=MINUTES_OF_RUNS),
    params:
        purpose="validation",
        sample=int(REPRESENTATIVE),
        seeds=1,
        more=["--trajectory", "0.1"],
    message:
        "Pouring the representative solution before the camera"


rule film:
    input:
        trajectory=rules.trajectory.output.trajectory,
        particle=rules.shape.output.particle,
    output:
        f"{RESULTS}/film/pour.gif",
    log:
        f"{RESULTS}/logs/film.log",
    benchmark:
        f"{RESULTS}/benchmarks/film.tsv"
    resources:
        **resources_for_attempt(450, minutes=20),
    params:
        config=CONFIG,
        code=code_hash("report.renderer.film"),
        settings=select_sections("funnel", "colour", "small_run"),
    message:
        "Film of the pour"
    shell:
        "python -m repose film {input.trajectory:q} --config {params.config:q} --particle {input.particle:q}"
        " --out {output:q} > {log:q} 2>&1"
