# A rule for each figure of this study, of its entry in `repose.report.figures.catalogue`.
if not PUBLISHED_IS_STORED:
    FIGURES.pop("published")
# The names in braces of the figures' inputs, which `repose.report.figures.registry` explains; the other inputs are files
# below the folder of results.
PLACES = {
    "answer": find_answer(),
    "config": config,
    "published": config["validation"]["published"] if PUBLISHED_SOLUTIONS else "",
    "simulated": STORED if PUBLISHED_IS_STORED else "",
    "stored": "" if IS_EXTERNAL else rules.validate.output.published,
    "table3": find_published_table("table3.csv") or "",
    "trajectory": "" if IS_EXTERNAL else rules.trajectory.output.trajectory,
}

for name, shown in FIGURES.items():
    path, inputs = find_figure_paths(name)[name], find_input_paths(
        {**shown.inputs, **shown.optional}, PLACES
    )
    there = {
        name: path
        for name, path in find_input_paths(shown.if_there, PLACES).items()
        if os.path.isfile(path)
    }

    rule:
        name:
            f"draw_{name}"
        input:
            **inputs,
        output:
            figure=report(
                path,
                caption="../report/figure.rst",
                category=shown.category,
                labels={"figure": shown.title},
            ),
            further=list_other_formats(path),
        log:
            f"{RESULTS}/logs/figures/{name}.log",
        benchmark:
            f"{RESULTS}/benchmarks/figures/{name}.tsv"
        resources:
            **resources_for_attempt(shown.memory_mb),
        params:
            config=CONFIG,
            code=code_hash("report.figures"),
            figure=name,
            inputs=[
                f"--input={key}={path}" for key, path in {**inputs, **there}.items()
            ],
            # No rule is asked for these files, so the figure is drawn anew when they change.
            there=[hash_content(Path(path).read_text()) for path in there.values()],
            settings=select_sections("small_run", *shown.reads) | RESOLUTION,
            caption=shown.caption_of(config),
        message:
            "Drawing {params.figure}"
        shell:
            "python -m repose figure {params.figure:q} --config {params.config:q} {params.inputs:q} --out {output.figure:q}"
            " > {log:q} 2>&1"


# The others belong to a study or strategy.
rule figures:
    input:
        list_figure_files(*list_figure_names("figures")),
