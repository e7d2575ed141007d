# The solutions, simulated again by a program of the user's own.
def runs_of_solution(sample):
    """Number of runs of a solution: the representative one gets more."""
    section = STUDY.settings.validation
    if sample == OWN_SOLUTIONS[0]:
        return section.representative_seeds
    return section.seeds


def runs_of_solutions():
    """Records of the runs of all solutions."""
    return [
        path
        for sample in OWN_SOLUTIONS
        for path in records(
            f"{RESULTS}/validation/{FOLDERS[0]}", sample, runs_of_solution(sample)
        )
    ]


use rule simulate as validation_simulate with:
    input:
        samples=rules.solutions.output.solutions,
    output:
        record=f"{RESULTS}/validation/{{runs}}/{{sample}}/{{run}}.json",
    log:
        f"{RESULTS}/logs/validation/{{runs}}/{{sample}}_{{run}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/validation/{{runs}}/{{sample}}_{{run}}.tsv"
    params:
        purpose="validation",
    message:
        "{PROGRAM.name}, solution {params.sample}, run {wildcards.run}: {params.command}"


use rule measure_runs as measure_validation_runs with:
    input:
        records=runs_of_solutions(),
        samples=rules.solutions.output.solutions,
    output:
        result=for_each(OWN_SOLUTIONS, f"{RESULTS}/validation/{{runs}}/{{sample}}.json"),
    log:
        f"{RESULTS}/logs/validation/{{runs}}_measured.log",
    benchmark:
        f"{RESULTS}/benchmarks/validation/{{runs}}_measured.tsv"
