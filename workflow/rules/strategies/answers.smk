# The answer of every strategy with several batches, its figures, and a target by the name of the strategy:
# `snakemake --cores 2 sequential`.
for name in BATCHED:

    rule:
        name:
            f"conclude_{name}"
        input:
            proposals=lambda wildcards, name=name: expand(
                rules.propose.output.proposal,
                strategy=name,
                batch=range(FIRST_BATCH[name], answer_of_batches(name)[0] + 1),
            ),
            tables=lambda wildcards, name=name: tables_in(
                folders_of_batches(name, answer_of_batches(name)[1])
            ),
        output:
            solutions=f"{RESULTS}/{name}/solutions.csv",
            table4=f"{RESULTS}/{name}/table4.csv",
            representative=f"{RESULTS}/{name}/representative.csv",
            check=f"{RESULTS}/{name}/check.csv",
            summary=f"{RESULTS}/{name}/summary.json",
            batches=f"{RESULTS}/{name}/batches.csv",
            dataset=f"{RESULTS}/{name}/dataset.csv",
            runs=f"{RESULTS}/{name}/runs.csv",
            own=[f"{RESULTS}/{name}/{file}" for file in strategies.strategy(name).files],
        log:
            f"{RESULTS}/logs/{name}/concluded.log",
        benchmark:
            f"{RESULTS}/benchmarks/{name}/concluded.tsv"
        resources:
            **resources_for_attempt(350),
        params:
            config=CONFIG,
            folder=find_output_folder,
            settings=select_stage_settings("conclude", strategy_name=name),
            code=code_hash("stages.batches"),
            strategy=name,
            batches=lambda wildcards, input: list(
                dict.fromkeys(
                    map(os.path.dirname, [*input.tables, input.proposals[-1]])
                )
            ),
        message:
            "The answer of {params.strategy}, simulated again, compared with its prediction and the targets"
        shell:
            "python -m repose stage conclude {params.strategy:q} {params.batches:q} --config {params.config:q}"
            " --out {params.folder:q} > {log:q} 2>&1"

    concluded = getattr(rules, f"conclude_{name}").output
    ANSWERS[name] = Answer(
        f"conclude_{name}",
        concluded.solutions,
        concluded.summary,
        concluded.table4,
        concluded.representative,
        concluded.dataset,
    )

    rule:
        name:
            name
        input:
            concluded,
            lambda wildcards, name=name: files_of_batches(name),
            list_figure_files(*list_figure_names(name)),
            f"{find_card_folder(name)}/card.json",
            f"{find_card_folder(name)}/report.html",
