# The loop closed: `snakemake --cores 2 refined`. Each round pours its proposal, judges it and, as long as it misses
# a target, refits the surrogate and searches again; a round is a checkpoint, so the next one is planned when it is done.
rule refine_propose:
    input:
        lambda wildcards: expand(
            "{folder}/{name}.csv",
            folder=runs_before(wildcards),
            name=("dataset", "runs"),
        ),
    output:
        proposal=f"{REFINED}/round_{{round}}/proposal.csv",
        network=f"{REFINED}/round_{{round}}/network/network.json",
        metrics=f"{REFINED}/round_{{round}}/network/metrics.json",
        predictions=f"{REFINED}/round_{{round}}/network/predictions.csv",
        starts=f"{REFINED}/round_{{round}}/network/starts.csv",
        corrected=f"{REFINED}/round_{{round}}/miga/network.json",
        feasible=f"{REFINED}/round_{{round}}/miga/feasible.csv",
        summary=f"{REFINED}/round_{{round}}/miga/summary.json",
    log:
        f"{RESULTS}/logs/refined/{{round}}_propose.log",
    wildcard_constraints:
        round=r"\d{1,2}",
    resources:
        **needs(300, minutes=90),
    params:
        **of_stage("refine_propose"),
        runs=runs_before,
    message:
        "Fit, search and proposal of round {wildcards.round}, and its neighbours"
    shell:
        "python -m repose stage refine_propose {params.runs:q} --config {params.config:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


checkpoint refine_round:
    input:
        proposal=rules.refine_propose.output.proposal,
        dataset=f"{REFINED}/round_{{round}}/dataset.csv",
        runs=f"{REFINED}/round_{{round}}/runs.csv",
    output:
        verdict=f"{REFINED}/round_{{round}}/verdict.json",
        points=f"{REFINED}/round_{{round}}/round.csv",
    log:
        f"{RESULTS}/logs/refined/{{round}}_judge.log",
    wildcard_constraints:
        round=r"\d{1,2}",
    resources:
        **needs(300),
    params:
        **of_stage("refine_judge"),
    message:
        "Judging round {wildcards.round}"
    shell:
        "python -m repose stage refine_judge --config {params.config:q} --proposal {input.proposal:q}"
        " --dataset {input.dataset:q} --runs {input.runs:q} --out {params.folder:q} > {log:q} 2>&1"


rule refine_tables:
    input:
        verdicts=verdicts,
    output:
        rounds=f"{REFINED}/rounds.csv",
        summary=f"{REFINED}/summary.json",
    log:
        f"{RESULTS}/logs/refine_tables.log",
    resources:
        **needs(300),
    params:
        **of_stage("refine_tables"),
    message:
        "All rounds of the refinement"
    shell:
        "python -m repose stage refine_tables {input.verdicts:q} --config {params.config:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


figure(
    "approach",
    "The loop closed",
    "targets",
    "refine.tolerance_percent",
    "refine.standard_error_percent",
    folder="refined",
    rounds=rules.refine_tables.output.rounds,
    summary=rules.refine_tables.output.summary,
)


# Every file by name, as in the method's chain: a lost file is made again.
rule refined:
    input:
        files_of_rounds,
        rules.refine_tables.output,
        all_files("approach"),
